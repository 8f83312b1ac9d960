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

}  // namespace diorama
