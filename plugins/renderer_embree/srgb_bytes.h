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
  std::uint8_t operator()(float linear) const {
    const float shown = linear > 0.0f ? std::min(linear, 1.0f) : 0.0f;
    return bytes_[std::size_t(std::sqrt(shown) * float(bytes_.size() - 1) + 0.5f)];
  }

 private:
  std::array<std::uint8_t, 8192> bytes_;
};

}  // namespace diorama
