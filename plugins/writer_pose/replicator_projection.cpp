// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/replicator_projection.h"

#include <cmath>

#include "writer_support/camera_matrices.h"

namespace diorama {
namespace {

Vec2 project_pinhole(const Camera& camera, const Vec3& p) {
  const Vec2 size(camera.width, camera.height);
  const Eigen::RowVector4d clip = p.homogeneous().transpose() * projection_matrix(camera);
  if (std::abs(clip[3]) < 1e-10) return 0.5 * size;
  return {(clip[0] / clip[3] + 1.0) * 0.5 * size.x(), (1.0 - clip[1] / clip[3]) * 0.5 * size.y()};
}

Vec2 project_opencv(const Camera& camera, const Vec3& p) {
  if (std::abs(p.z()) < 1e-10) return {camera.cx, camera.cy};
  return {camera.fx * (p.x() / -p.z()) + camera.cx, camera.fy * (-p.y() / -p.z()) + camera.cy};
}

/// The radius in pixels at which the polynomial gives `theta`, by Newton's method.
double fisheye_radius(const std::array<double, 6>& k, double theta) {
  double r = k[1] == 0.0 ? theta : (theta - k[0]) / k[1];
  if (k[2] == 0.0 && k[3] == 0.0 && k[4] == 0.0 && k[5] == 0.0) return r;
  for (int i = 0; i < 10; ++i) {
    const double value =
        k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * (k[4] + r * k[5])))) - theta;
    const double slope =
        k[1] + r * (2.0 * k[2] + r * (3.0 * k[3] + r * (4.0 * k[4] + r * 5.0 * k[5])));
    if (slope == 0.0) break;
    const double step = value / slope;
    r -= step;
    if (std::abs(step) < 1e-6) break;
  }
  return r;
}

Vec2 project_fisheye(const Camera& camera, const Vec3& p) {
  const double rho = std::hypot(p.x(), p.y());
  if (rho < 1e-10) return {camera.cx, camera.cy};
  const double r = fisheye_radius(camera.fisheye_polynomial, std::atan2(rho, -p.z()));
  return {camera.cx + r * p.x() / rho, camera.cy - r * p.y() / rho};
}

}  // namespace

Vec2 replicator_project(const Camera& camera, const Vec3& point_camera) {
  switch (camera.lens) {
    case LensModel::OpencvPinhole:
      return project_opencv(camera, point_camera);
    case LensModel::FisheyePolynomial:
      return project_fisheye(camera, point_camera);
    case LensModel::Pinhole:
      break;
  }
  return project_pinhole(camera, point_camera);
}

}  // namespace diorama
