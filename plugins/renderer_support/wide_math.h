// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

namespace diorama {

// Of our own, because libraries differ from one another; loops over them become vector code.

/// e^x to 3e-7, for x in [-80, 80].
inline float fast_exp(float x) {
  const float scaled = x * 1.44269504f;
  constexpr float kMagic = 12582912.0f;  // 1.5 * 2^23: the sum's last bits are the whole number
  const float shifted = scaled + kMagic;
  const float f = (scaled - (shifted - kMagic)) * 0.69314718f;
  const float power =
      1.0f +
      f * (1.0f +
           f * (0.5f + f * (1.66666667e-1f +
                            f * (4.16666667e-2f + f * (8.3333333e-3f + f * 1.3888889e-3f)))));
  const std::int32_t whole = std::bit_cast<std::int32_t>(shifted) - 0x4B400000;
  return power * std::bit_cast<float>((whole + 127) << 23);
}

/// ln(1 + x) to 1e-6, for x in [0, 1e30].
inline float fast_log1p(float x) {
  const auto bits = std::bit_cast<std::int32_t>(1.0f + x);
  const std::int32_t exponent = (bits - 0x3F3504F3) >> 23;
  const float mantissa = std::bit_cast<float>(bits - (exponent << 23));
  const float s = (mantissa - 1.0f) / (mantissa + 1.0f);
  const float s2 = s * s;
  const float series =
      2.0f * s *
      (1.0f + s2 * (3.3333333e-1f + s2 * (0.2f + s2 * (1.4285714e-1f + s2 * 1.1111111e-1f))));
  return series + float(exponent) * 0.69314718f;
}

}  // namespace diorama
