// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

namespace diorama::training {

/// The nearest half-precision number; beyond their range the largest, and zero for what is none.
inline std::uint16_t half_bits(float value) {
  constexpr float kLargest = 65504.0f;
  if (!(value == value)) return 0;
  if (value > kLargest) value = kLargest;
  if (value < -kLargest) value = -kLargest;
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const auto sign = std::uint16_t(bits >> 16 & 0x8000u);
  const std::uint32_t magnitude = bits & 0x7FFFFFFFu;
  if (magnitude < 0x38800000u) {
    // Subnormal: by adding a number whose last bit is theirs.
    const float shifted = std::bit_cast<float>(magnitude) + 0.5f;
    return std::uint16_t(sign | (std::bit_cast<std::uint32_t>(shifted) - 0x3F000000u));
  }
  const std::uint32_t rounded = magnitude + 0xFFFu + (magnitude >> 13 & 1u);
  return std::uint16_t(sign | ((rounded - 0x38000000u) >> 13));
}

}  // namespace diorama::training
