// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/camera.h"
#include "diorama/host.h"
#include "diorama/image.h"

namespace diorama {

struct LensEffects {
  double vignetting = 0.0;    ///< Light falls off as cos(angle off the axis)^(4 vignetting).
  double red_shift_px = 0.0;  ///< How much farther out red is imaged half a diagonal from the axis.
  double blue_shift_px = 0.0;
};

/// The picture behind a lens with these faults. Light from outside the picture is that of its edge.
Image<Vec3f> through_lens(const Image<Vec3f>& radiance, const Camera& camera,
                          const LensEffects& effects, Host& host);

}  // namespace diorama
