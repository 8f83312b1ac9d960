// SPDX-License-Identifier: Apache-2.0
#include "diorama/image.h"

#include <algorithm>
#include <cmath>

namespace diorama {

PixelBox PixelBox::clipped(int image_width, int image_height) const {
  return {std::max(x_min, 0), std::max(y_min, 0), std::min(x_max, image_width),
          std::min(y_max, image_height)};
}

float srgb_from_linear(float linear) {
  if (linear <= 0.0031308f) return 12.92f * linear;
  return 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

float linear_from_srgb(float srgb) {
  if (srgb <= 0.04045f) return srgb / 12.92f;
  return std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}

}  // namespace diorama
