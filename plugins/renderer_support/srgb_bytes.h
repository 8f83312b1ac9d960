// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "diorama/image.h"

namespace diorama {

/// sRGB bytes of linear values, by table over the square root, where the encoding's steps are even.
class SrgbBytes {
 public:
  SrgbBytes() {
    for (std::size_t i = 0; i < bytes_.size(); ++i) {
      const float root = float(i) / float(bytes_.size() - 1);
      bytes_[i] = std::uint8_t(srgb_from_linear(root * root) * 255.0f + 0.5f);
    }
  }
  /// Values outside [0, 1] are clipped; what is no number is black.
  std::uint8_t operator()(float linear) const { return bytes_[std::size_t(place_of(linear))]; }

  /// The same in two steps, the first of which compilers make vectors of.
  static std::int32_t place_of(float linear) {
    const float shown = linear > 0.0f ? std::min(linear, 1.0f) : 0.0f;
    return std::int32_t(std::sqrt(shown) * float(kSize - 1) + 0.5f);
  }
  std::uint8_t operator[](std::int32_t place) const { return bytes_[std::size_t(place)]; }

 private:
  static constexpr std::size_t kSize = 8192;
  std::array<std::uint8_t, kSize> bytes_;
};

/// What bytes mean, from 0 to 1: by the encoding of sRGB, or evenly.
inline const std::array<float, 256>& linear_from_byte(bool is_srgb) {
  static const auto tables = [] {
    std::array<std::array<float, 256>, 2> made;
    for (std::size_t i = 0; i < 256; ++i) {
      const float value = float(i) / 255.0f;
      made[0][i] = value;
      made[1][i] = linear_from_srgb(value);
    }
    return made;
  }();
  return tables[is_srgb ? 1 : 0];
}

}  // namespace diorama
