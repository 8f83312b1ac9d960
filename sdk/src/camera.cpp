// SPDX-License-Identifier: Apache-2.0
#include "diorama/camera.h"

#include <cmath>

#include "diorama/error.h"

namespace diorama {

namespace {

using Mat2 = Eigen::Matrix2d;

/// Image plane coordinates at depth 1, x right and y down, after the lens; with the derivative.
struct Distorted {
  Vec2 point;
  Mat2 jacobian;
  double radial;

  /// Strong distortion folds the plane over beyond some radius; what lies there is not imaged.
  bool is_unfolded() const { return radial > 0.0 && jacobian.determinant() > 0.0; }
};

// The rational model of OpenCV's calib3d: k1 k2 p1 p2 k3 k4 k5 k6.
Distorted distort(const std::array<double, 8>& k, const Vec2& p) {
  const double x = p.x(), y = p.y(), p1 = k[2], p2 = k[3];
  const double r2 = p.squaredNorm();
  const double above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double below = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  const double above_slope = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]);  // by r2
  const double below_slope = k[5] + r2 * (2.0 * k[6] + r2 * 3.0 * k[7]);

  Distorted out;
  out.radial = above / below;
  out.point = p * out.radial + Vec2(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                                    p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
  const double slope = (above_slope * below - above * below_slope) / (below * below);
  out.jacobian = out.radial * Mat2::Identity() + 2.0 * slope * p * p.transpose();
  const double mixed = 2.0 * (p1 * x + p2 * y);
  out.jacobian += Mat2{{2.0 * p1 * y + 6.0 * p2 * x, mixed}, {mixed, 6.0 * p1 * y + 2.0 * p2 * x}};
  return out;
}

/// Newton steps, halved while they do not come closer.
std::optional<Vec2> undistort(const std::array<double, 8>& k, const Vec2& wanted) {
  constexpr int kSteps = 50;
  constexpr double kTolerance = 1e-12;
  Vec2 p = wanted;
  Distorted at = distort(k, p);
  // The undistorted point lies further in or out than `wanted`; a fold may lie between.
  for (int i = 0; i < 60 && !at.is_unfolded(); ++i) at = distort(k, p *= 0.8);

  for (int i = 0; i < kSteps; ++i) {
    const Vec2 miss = wanted - at.point;
    if (miss.norm() <= kTolerance * (1.0 + wanted.norm())) return p;
    if (!at.is_unfolded()) return std::nullopt;
    const Vec2 step = at.jacobian.inverse() * miss;
    double share = 1.0;
    Distorted next = distort(k, p + step);
    while (share > 1e-6 && !(next.is_unfolded() && (wanted - next.point).norm() < miss.norm())) {
      next = distort(k, p + (share *= 0.5) * step);
    }
    p += share * step;
    at = next;
  }
  return std::nullopt;
}

double angle_at(const std::array<double, 6>& c, double r) {
  return c[0] + r * (c[1] + r * (c[2] + r * (c[3] + r * (c[4] + r * c[5]))));
}

double slope_at(const std::array<double, 6>& c, double r) {
  return c[1] + r * (2 * c[2] + r * (3 * c[3] + r * (4 * c[4] + r * 5 * c[5])));
}

/// Distance from the optical centre in pixels of what is seen `angle` off the axis: Newton inside a
/// bracket, so that it cannot leave.
std::optional<double> radius_of(const std::array<double, 6>& c, double angle) {
  if (angle == angle_at(c, 0.0)) return 0.0;
  if (angle < angle_at(c, 0.0)) return std::nullopt;
  double lo = 0.0;
  double hi = c[1] > 0.0 ? (angle - c[0]) / c[1] : 1.0;
  for (int i = 0; i < 40 && angle_at(c, hi) < angle; ++i) hi = 2.0 * (lo = hi);
  if (!(angle_at(c, hi) >= angle)) return std::nullopt;

  double r = 0.5 * (lo + hi);
  for (int i = 0; i < 200; ++i) {
    const double miss = angle_at(c, r) - angle;
    (miss < 0.0 ? lo : hi) = r;
    double next = r - miss / slope_at(c, r);
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    if (std::abs(next - r) <= 1e-12 * (1.0 + r)) return next;
    r = next;
  }
  return r;
}

std::optional<Vec2> project_fisheye(const Camera& camera, const Vec3& point) {
  const double across = point.head<2>().norm();
  const double angle = std::atan2(across, -point.z());
  if (point.isZero(0.0) || angle > camera.fisheye_max_angle_rad) return std::nullopt;
  const std::optional<double> r = radius_of(camera.fisheye_polynomial, angle);
  if (!r || !(slope_at(camera.fisheye_polynomial, *r) > 0.0)) return std::nullopt;
  const Vec2 towards = across > 0.0 ? Vec2(point.x() / across, -point.y() / across) : Vec2(1, 0);
  return Vec2(camera.cx, camera.cy) + *r * towards;
}

std::optional<Vec3> fisheye_direction(const Camera& camera, const Vec2& pixel) {
  const Vec2 off = pixel - Vec2(camera.cx, camera.cy);
  const double r = off.norm();
  const double angle = angle_at(camera.fisheye_polynomial, r);
  if (!(angle >= 0.0 && angle <= camera.fisheye_max_angle_rad)) return std::nullopt;
  if (!(slope_at(camera.fisheye_polynomial, r) > 0.0)) return std::nullopt;
  const Vec2 towards = r > 0.0 ? Vec2(off / r) : Vec2(1, 0);
  return Vec3(std::sin(angle) * towards.x(), -std::sin(angle) * towards.y(), -std::cos(angle));
}

}  // namespace

Camera Camera::from_lens(int width, int height, double focal_length_mm,
                         double horizontal_aperture_mm) {
  if (width < 1 || height < 1 || !(focal_length_mm > 0.0) || !(horizontal_aperture_mm > 0.0)) {
    throw Error(ErrorKind::Config,
                "camera: width, height, focal length and aperture must be greater than 0");
  }
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.focal_length_mm = focal_length_mm;
  camera.horizontal_aperture_mm = horizontal_aperture_mm;
  camera.fx = camera.fy = focal_length_mm * width / horizontal_aperture_mm;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  return camera;
}

std::optional<Vec2> project(const Camera& camera, const Vec3& point_camera) {
  if (camera.lens == LensModel::FisheyePolynomial) return project_fisheye(camera, point_camera);
  const double depth = -point_camera.z();
  if (!(depth > 0.0)) return std::nullopt;
  Vec2 p(point_camera.x() / depth, -point_camera.y() / depth);
  if (camera.lens == LensModel::OpencvPinhole) {
    const Distorted lens = distort(camera.distortion, p);
    if (!lens.is_unfolded()) return std::nullopt;
    p = lens.point;
  }
  return Vec2(camera.fx * p.x() + camera.cx, camera.fy * p.y() + camera.cy);
}

std::optional<Vec3> ray_direction(const Camera& camera, const Vec2& pixel) {
  if (camera.lens == LensModel::FisheyePolynomial) return fisheye_direction(camera, pixel);
  Vec2 p((pixel.x() - camera.cx) / camera.fx, (pixel.y() - camera.cy) / camera.fy);
  if (camera.lens == LensModel::OpencvPinhole) {
    const std::optional<Vec2> undistorted = undistort(camera.distortion, p);
    if (!undistorted) return std::nullopt;
    p = *undistorted;
  }
  return Vec3(p.x(), -p.y(), -1.0).normalized();
}

}  // namespace diorama
