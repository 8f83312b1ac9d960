// SPDX-License-Identifier: Apache-2.0
#include "crate_cursor.h"

#include <lz4.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <type_traits>

namespace diorama::usd {
namespace {

// No LZ4 block decodes to more than this many times its size.
constexpr std::uint64_t kMaxExpansion = 255;
// The shortest match that a sequence copies.
constexpr std::uint64_t kMinMatch = 4;
// Integers that a list may have for each byte of the file, and whatever its size: far above real
// files, far below what could exhaust the memory.
constexpr std::uint64_t kMaxIntegersPerByte = 64;
constexpr std::uint64_t kFreeIntegers = 1 << 20;
constexpr std::uint64_t kMaxChunk = 0x7E000000;

// What a block decodes to, by the lengths that its sequences say (lz4_Block_format.md); nothing
// when it is cut off. Memory is taken for that much only: what a file claims elsewhere may be a
// lie.
std::optional<std::uint64_t> decoded_size(std::span<const std::byte> block) {
  std::uint64_t total = 0;
  std::size_t at = 0;
  const auto next = [&]() -> std::uint64_t {
    return at < block.size() ? std::to_integer<std::uint64_t>(block[at++]) : 0;
  };
  const auto length = [&](std::uint64_t nibble) {
    std::uint64_t result = nibble;
    if (nibble != 15) return result;
    std::uint64_t more = 255;
    while (more == 255 && at < block.size()) {
      more = next();
      result += more;
    }
    return result;
  };
  while (at < block.size()) {
    const std::uint64_t token = next();
    const std::uint64_t literals = length(token >> 4);
    if (literals > block.size() - at) return std::nullopt;
    at += literals;
    total += literals;
    if (at == block.size()) return total;  // the last sequence has literals only
    if (block.size() - at < 2) return std::nullopt;
    at += 2;
    total += length(token & 15) + kMinMatch;
  }
  return std::nullopt;
}

template <class T>
std::int64_t read_signed(std::span<const std::byte> bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

}  // namespace

std::uint64_t CrateCursor::read_count(std::uint64_t item_size, const char* what) {
  const std::uint64_t start = position_;
  const auto count = read<std::uint64_t>(what);
  if (count > remaining() / item_size) {
    fail_at(std::to_string(count) + " " + what + " do not fit into the " +
                std::to_string(remaining()) + " bytes that are left",
            start);
  }
  return count;
}

CrateCursor CrateCursor::relative(std::int64_t offset) const {
  const bool is_inside = offset >= 0 ? static_cast<std::uint64_t>(offset) <= remaining()
                                     : offset >= -static_cast<std::int64_t>(position_);
  if (!is_inside) fail("a relative offset points outside of the file");
  return CrateCursor(*file_, bytes_, position_ + static_cast<std::uint64_t>(offset));
}

std::vector<std::byte> CrateCursor::read_compressed(std::uint64_t compressed_size,
                                                    std::uint64_t limit, const char* what) {
  const std::uint64_t start = position_;
  const auto block = take(compressed_size, what);
  if (block.empty()) {
    if (limit == 0) return {};
    fail_at(std::string(what) + ": the compressed block is empty", start);
  }
  CrateCursor chunk(*file_, bytes_.first(position_), start + 1);
  const int chunks = std::to_integer<int>(block[0]);
  std::vector<std::byte> result;
  for (int i = 0; i < std::max(chunks, 1); ++i) {
    const std::int64_t size =
        chunks == 0 ? static_cast<std::int64_t>(block.size() - 1) : chunk.read<std::int32_t>(what);
    if (size < 0 || size > std::numeric_limits<int>::max()) {
      fail_at(std::string(what) + ": a compressed chunk has an impossible size", start);
    }
    const auto input = chunk.take(static_cast<std::uint64_t>(size), what);
    const auto decoded = decoded_size(input);
    const std::uint64_t filled = result.size();
    if (!decoded || *decoded > std::min(limit - filled, kMaxChunk)) {
      fail_at(std::string(what) + ": the compressed data is damaged", start);
    }
    result.resize(filled + *decoded);
    const int written = LZ4_decompress_safe(reinterpret_cast<const char*>(input.data()),
                                            reinterpret_cast<char*>(result.data() + filled),
                                            static_cast<int>(size), static_cast<int>(*decoded));
    if (written < 0 || static_cast<std::uint64_t>(written) != *decoded) {
      fail_at(std::string(what) + ": the compressed data is damaged", start);
    }
  }
  return result;
}

template <class Integer>
std::vector<Integer> CrateCursor::read_integers(std::uint64_t count, const char* what) {
  using Signed = std::make_signed_t<Integer>;
  using Unsigned = std::make_unsigned_t<Integer>;
  using Small = std::conditional_t<sizeof(Integer) == 4, std::int8_t, std::int16_t>;
  using Medium = std::conditional_t<sizeof(Integer) == 4, std::int16_t, std::int32_t>;
  const std::uint64_t start = position_;
  const auto compressed_size = read<std::uint64_t>(what);
  if (compressed_size > remaining()) {
    fail_at(std::string(what) + ": " + std::to_string(compressed_size) +
                " compressed bytes do not fit into the file",
            start);
  }
  // Each integer takes at least two bits before compression. Equal steps shrink to next to nothing,
  // but never are all that a file holds.
  if (count > compressed_size * kMaxExpansion * 4 ||
      count > bytes_.size() * kMaxIntegersPerByte + kFreeIntegers) {
    fail_at(std::to_string(count) + " " + what + " cannot be stored in " +
                std::to_string(compressed_size) + " bytes",
            start);
  }
  if (count == 0) {
    take(compressed_size, what);
    return {};
  }
  const std::uint64_t code_bytes = (2 * count + 7) / 8;
  const std::vector<std::byte> coded = read_compressed(
      compressed_size, sizeof(Integer) + code_bytes + count * sizeof(Integer), what);
  std::uint64_t at = sizeof(Integer) + code_bytes;
  if (coded.size() < at) fail_at(std::string(what) + ": the coded integers are cut off", start);
  const auto common = static_cast<Unsigned>(read_signed<Signed>(coded, 0));
  std::vector<Integer> result(count);
  Unsigned sum = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const int code = (std::to_integer<int>(coded[sizeof(Integer) + i / 4]) >> (2 * (i % 4))) & 3;
    constexpr std::uint8_t kSizes[] = {0, sizeof(Small), sizeof(Medium), sizeof(Signed)};
    if (at + kSizes[code] > coded.size()) {
      fail_at(std::string(what) + ": the coded integers are cut off", start);
    }
    switch (code) {
      case 0:
        sum += common;
        break;
      case 1:
        sum += static_cast<Unsigned>(read_signed<Small>(coded, at));
        break;
      case 2:
        sum += static_cast<Unsigned>(read_signed<Medium>(coded, at));
        break;
      default:
        sum += static_cast<Unsigned>(read_signed<Signed>(coded, at));
        break;
    }
    at += kSizes[code];
    result[i] = static_cast<Integer>(sum);
  }
  return result;
}

template std::vector<std::int32_t> CrateCursor::read_integers(std::uint64_t, const char*);
template std::vector<std::uint32_t> CrateCursor::read_integers(std::uint64_t, const char*);
template std::vector<std::int64_t> CrateCursor::read_integers(std::uint64_t, const char*);
template std::vector<std::uint64_t> CrateCursor::read_integers(std::uint64_t, const char*);

}  // namespace diorama::usd
