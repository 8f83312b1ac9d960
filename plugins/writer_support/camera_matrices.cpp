// SPDX-License-Identifier: Apache-2.0
#include "writer_support/camera_matrices.h"

#include <cmath>

namespace diorama {

Mat4 row_vector_matrix(const Affine& map) { return map.matrix().transpose(); }

Mat4 view_matrix(const Frame& frame) {
  return row_vector_matrix(frame.world_from_camera.inverse());
}

Mat4 projection_matrix(const Camera& camera) {
  const double near = camera.near_m;
  const double far = camera.far_m;
  Mat4 clip_from_camera = Mat4::Zero();
  clip_from_camera(0, 0) = 2.0 * camera.fx / camera.width;
  clip_from_camera(0, 2) = 1.0 - 2.0 * camera.cx / camera.width;
  clip_from_camera(1, 1) = 2.0 * camera.fy / camera.height;
  clip_from_camera(1, 2) = 2.0 * camera.cy / camera.height - 1.0;
  clip_from_camera(2, 2) = near / (far - near);
  clip_from_camera(2, 3) = near * far / (far - near);
  clip_from_camera(3, 2) = -1.0;
  return clip_from_camera.transpose();
}

const char* replicator_camera_model(const Camera& camera) {
  switch (camera.lens) {
    case LensModel::OpencvPinhole:
      return "pinholeOpenCV";
    case LensModel::FisheyePolynomial:
      return "fisheyePolynomial";
    case LensModel::Pinhole:
      break;
  }
  return "pinhole";
}

Vec2 aperture_mm(const Camera& camera) {
  const double per_pixel = camera.horizontal_aperture_mm / camera.width;
  return {camera.horizontal_aperture_mm, per_pixel * camera.height};
}

Vec2 aperture_offset_mm(const Camera& camera) {
  const double per_pixel = camera.horizontal_aperture_mm / camera.width;
  // 0.0 - x rather than -x: a centred camera has no negative zero.
  return {0.0 - (camera.cx - 0.5 * camera.width) * per_pixel,
          (camera.cy - 0.5 * camera.height) * per_pixel};
}

double focal_length_mm(const Camera& camera) {
  const double from_pixels = camera.fx * camera.horizontal_aperture_mm / camera.width;
  // The described value where it agrees, so that 24 stays 24.
  const bool agrees = std::abs(from_pixels - camera.focal_length_mm) <= 1e-9 * from_pixels;
  return agrees ? camera.focal_length_mm : from_pixels;
}

}  // namespace diorama
