// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/camera.h"
#include "writer_support/python_json.h"

namespace diorama {

/// What intrinsics leave out, in full precision: {"model": "pinhole"}, {"model": "opencv_pinhole",
/// "distortion": [k1 k2 p1 p2 k3 k4 k5 k6]} or {"model": "fisheye_polynomial", "polynomial": [angle
/// off the axis by the radius in pixels, six factors], "max_angle_rad": ...}.
Json lens_json(const Camera& camera);

/// fx, fy, cx, cy in pixels, of a pinhole that sees what the lens sees at its centre. A fisheye
/// lens's own polynomial says its focal length there; Camera::fx has no part in it.
struct Intrinsics {
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
};
Intrinsics intrinsics_of(const Camera& camera);
/// [fx, fy, cx, cy].
Json intrinsics_json(const Camera& camera);

}  // namespace diorama
