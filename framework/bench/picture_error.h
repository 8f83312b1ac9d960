// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/image.h"

namespace diorama::bench {

/// How far a picture in linear light is from its reference.
struct PictureError {
  double rmse = 0.0;          ///< Root of the mean square difference of the colours.
  double relative_mse = 0.0;  ///< Mean of d^2 / (reference^2 + 0.01) ...
  double trimmed_mse = 0.0;   ///< ... without the worst thousandth of the pixels.
  double bias = 0.0;          ///< Of the mean, relative.
};

/// Both must have the same size.
PictureError picture_error(const Image<Vec3f>& image, const Image<Vec3f>& reference);

}  // namespace diorama::bench
