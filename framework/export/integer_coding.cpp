// SPDX-License-Identifier: Apache-2.0
#include "framework/export/integer_coding.h"

#include <lz4.h>

#include <cstring>
#include <limits>
#include <map>

#include "diorama/error.h"

namespace diorama::usd_export {
namespace {

// OpenUSD, pxr/base/tf/fastCompression.cpp: larger inputs are cut into several blocks.
constexpr std::size_t kLargestBlock = 0x7E000000;

template <class Integer>
void append(Bytes& bytes, Integer value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof value);
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

template <class Small>
bool fits(std::int32_t value) {
  return value >= std::numeric_limits<Small>::min() && value <= std::numeric_limits<Small>::max();
}

/// The most frequent difference, the smallest of equally frequent ones.
std::int32_t most_frequent(std::span<const std::int32_t> values) {
  std::map<std::int32_t, std::size_t> counts;
  for (const std::int32_t value : values) ++counts[value];
  std::int32_t best = 0;
  std::size_t best_count = 0;
  for (const auto& [value, count] : counts) {
    if (count <= best_count) continue;
    best = value;
    best_count = count;
  }
  return best;
}

}  // namespace

Bytes compress(std::span<const std::byte> raw) {
  if (raw.size() > kLargestBlock) {
    throw Error(ErrorKind::Output, "a USD section of " + std::to_string(raw.size()) +
                                       " bytes is too large; at most 2 GB can be written");
  }
  Bytes bytes(1 + std::size_t(LZ4_compressBound(int(raw.size()))));
  const int size = LZ4_compress_default(reinterpret_cast<const char*>(raw.data()),
                                        reinterpret_cast<char*>(bytes.data()) + 1, int(raw.size()),
                                        int(bytes.size()) - 1);
  bytes.resize(std::size_t(size) + 1);
  return bytes;
}

Bytes code_integers(std::span<const std::int32_t> values) {
  std::vector<std::int32_t> steps;
  std::uint32_t before = 0;
  for (const std::int32_t value : values) {
    // Wraps around on purpose: the reader adds up in 32 bits.
    steps.push_back(std::int32_t(std::uint32_t(value) - before));
    before = std::uint32_t(value);
  }
  const std::int32_t common = most_frequent(steps);
  Bytes raw;
  append(raw, common);
  const std::size_t codes_at = raw.size();
  raw.resize(codes_at + (2 * steps.size() + 7) / 8);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    unsigned code = 0;
    if (steps[i] == common) {
      code = 0;
    } else if (fits<std::int8_t>(steps[i])) {
      code = 1;
      append(raw, std::int8_t(steps[i]));
    } else if (fits<std::int16_t>(steps[i])) {
      code = 2;
      append(raw, std::int16_t(steps[i]));
    } else {
      code = 3;
      append(raw, steps[i]);
    }
    raw[codes_at + i / 4] |= std::byte(code << (2 * (i % 4)));
  }
  return compress(raw);
}

}  // namespace diorama::usd_export
