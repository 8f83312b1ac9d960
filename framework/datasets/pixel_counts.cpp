// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/pixel_counts.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace diorama {
namespace {

using Bytes [[gnu::vector_size(16)]] = std::uint8_t;
using Shorts [[gnu::vector_size(16)]] = std::uint16_t;
using Words [[gnu::vector_size(16)]] = std::uint32_t;
using Floats [[gnu::vector_size(16)]] = float;

constexpr std::size_t kAtOnce = sizeof(Bytes) / sizeof(Rgba8);

Bytes four_of(const Rgba8& pixel) {
  std::uint32_t word = 0;
  std::memcpy(&word, pixel.data(), sizeof word);
  return std::bit_cast<Bytes>(Words{word, word, word, word});
}

constexpr std::uint8_t kBurnt = 254;

}  // namespace

ColorCounts color_counts(std::span<const Rgba8> pixels) {
  ColorCounts counts;
  if (pixels.empty()) return counts;
  const Bytes first = four_of(pixels[0]);
  const Bytes colors = four_of({255, 255, 255, 0});
  const Bytes burnt = four_of({kBurnt, kBurnt, kBurnt, 0});
  Bytes others{};
  Words burnt_pixels{};
  const std::size_t whole = pixels.size() / kAtOnce * kAtOnce;
  // So many sums of two bytes fit into 16 bits.
  constexpr std::size_t kPart = 128 * kAtOnce;
  for (std::size_t begin = 0; begin < whole; begin += kPart) {
    const std::size_t end = std::min(begin + kPart, whole);
    Shorts sums{};
    for (std::size_t i = begin; i < end; i += kAtOnce) {
      Bytes four;
      std::memcpy(&four, &pixels[i], sizeof four);
      others |= four ^ first;
      const auto values = std::bit_cast<Shorts>(four & colors);
      sums += (values & 255) + (values >> 8);
      const auto is_burnt = std::bit_cast<Words>(four >= burnt) == ~std::uint32_t(0);
      burnt_pixels -= std::bit_cast<Words>(is_burnt);
    }
    for (std::size_t i = 0; i < sizeof sums / sizeof sums[0]; ++i) counts.sum += sums[i];
  }
  for (std::size_t i = 0; i < kAtOnce; ++i) counts.burnt += burnt_pixels[i];
  counts.is_uniform = true;
  for (std::size_t i = 0; i < sizeof others; ++i) counts.is_uniform &= others[i] == 0;
  for (const Rgba8& pixel : pixels.subspan(whole)) {
    counts.sum += std::uint64_t(pixel[0]) + pixel[1] + pixel[2];
    counts.burnt += std::size_t(std::min({pixel[0], pixel[1], pixel[2]}) >= kBurnt);
    counts.is_uniform &= pixel == pixels[0];
  }
  return counts;
}

std::size_t count_below(std::span<const float> values, float limit) {
  constexpr std::size_t kFloats = sizeof(Floats) / sizeof(float);
  const Floats limits{limit, limit, limit, limit};
  Words below{};
  const std::size_t whole = values.size() / kFloats * kFloats;
  for (std::size_t i = 0; i < whole; i += kFloats) {
    Floats four;
    std::memcpy(&four, &values[i], sizeof four);
    below -= std::bit_cast<Words>(four < limits);
  }
  std::size_t count = 0;
  for (std::size_t i = 0; i < kFloats; ++i) count += below[i];
  for (const float value : values.subspan(whole)) count += std::size_t(value < limit);
  return count;
}

}  // namespace diorama
