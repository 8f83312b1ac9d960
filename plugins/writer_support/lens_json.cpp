// SPDX-License-Identifier: Apache-2.0
#include "writer_support/lens_json.h"

namespace diorama {

Json lens_json(const Camera& camera) {
  switch (camera.lens) {
    case LensModel::OpencvPinhole:
      return {{"model", "opencv_pinhole"}, {"distortion", camera.distortion}};
    case LensModel::FisheyePolynomial:
      return {{"model", "fisheye_polynomial"},
              {"polynomial", camera.fisheye_polynomial},
              {"max_angle_rad", camera.fisheye_max_angle_rad}};
    case LensModel::Pinhole:
      break;
  }
  return {{"model", "pinhole"}};
}

Intrinsics intrinsics_of(const Camera& camera) {
  Intrinsics result{camera.fx, camera.fy, camera.cx, camera.cy};
  // The angle off the axis grows by this much per pixel at the centre.
  const double growth = camera.fisheye_polynomial[1];
  if (camera.lens == LensModel::FisheyePolynomial && growth > 0.0)
    result.fx = result.fy = 1.0 / growth;
  return result;
}

Json intrinsics_json(const Camera& camera) {
  const Intrinsics k = intrinsics_of(camera);
  return {k.fx, k.fy, k.cx, k.cy};
}

}  // namespace diorama
