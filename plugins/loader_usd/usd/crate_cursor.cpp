// SPDX-License-Identifier: Apache-2.0
#include "crate_cursor.h"

#include <lz4.h>

#include <algorithm>
#include <limits>
#include <type_traits>

namespace diorama::usd {
namespace {

// No LZ4 block decodes to more than this many times its size.
constexpr std::uint64_t kMaxExpansion = 255;
constexpr std::uint64_t kMaxChunk = 0x7E000000;

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
  std::vector<std::byte> result(std::min(limit, compressed_size * kMaxExpansion + 64));
  std::uint64_t filled = 0;
  for (int i = 0; i < std::max(chunks, 1); ++i) {
    const std::int64_t size =
        chunks == 0 ? static_cast<std::int64_t>(block.size() - 1) : chunk.read<std::int32_t>(what);
    if (size < 0 || size > std::numeric_limits<int>::max()) {
      fail_at(std::string(what) + ": a compressed chunk has an impossible size", start);
    }
    const auto input = chunk.take(static_cast<std::uint64_t>(size), what);
    const auto room = static_cast<int>(std::min<std::uint64_t>(result.size() - filled, kMaxChunk));
    const int written = LZ4_decompress_safe(reinterpret_cast<const char*>(input.data()),
                                            reinterpret_cast<char*>(result.data() + filled),
                                            static_cast<int>(size), room);
    if (written < 0) fail_at(std::string(what) + ": the compressed data is damaged", start);
    filled += static_cast<std::uint64_t>(written);
  }
  result.resize(filled);
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
  // Each integer takes at least two bits before compression.
  if (count > compressed_size * kMaxExpansion * 4) {
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
