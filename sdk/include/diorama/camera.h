// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diorama/math.h"

namespace diorama {

enum class LensModel : std::uint8_t {
  Pinhole,
  OpencvPinhole,      ///< Pinhole with the rational distortion of OpenCV: k1 k2 p1 p2 k3 k4 k5 k6.
  FisheyePolynomial,  ///< theta = a + b r + c r^2 + d r^3 + e r^4 + f r^5, r in pixels.
};

/// A camera looking along -z of its node, x right, y up. Pixels are square only if fx == fy.
struct Camera {
  int width = 640;
  int height = 480;
  LensModel lens = LensModel::Pinhole;
  double fx = 600.0;  ///< Pixels.
  double fy = 600.0;
  double cx = 320.0;  ///< Pixels from the left edge; the image centre is width / 2.
  double cy = 240.0;
  std::array<double, 8> distortion{};          ///< OpencvPinhole.
  std::array<double, 6> fisheye_polynomial{};  ///< FisheyePolynomial.
  double fisheye_max_angle_rad = kPi;          ///< Largest angle off the axis that is imaged.
  double near_m = 0.25;                        ///< Nothing nearer along the axis is seen.
  double far_m = 1000.0;
  double focal_length_mm = 24.0;  ///< Of the described lens; pixels follow fx.
  double horizontal_aperture_mm = 20.955;
  double focus_distance_m = 0.0;
  double f_stop = 0.0;  ///< 0: no depth of field.
  /// The poses of a scene are those of the moment halfway through the exposure of the middle row;
  /// labels and geometry channels show that moment, whatever the shutter does to the picture.
  double exposure_time_s = 0.0;  ///< For which a row gathers light; 0: no motion blur.
  double readout_time_s = 0.0;   ///< From the first row to the last one; 0: all rows at once.
  Vec3 linear_velocity = Vec3::Zero();   ///< m/s, world; on top of that of a body it rides on.
  Vec3 angular_velocity = Vec3::Zero();  ///< rad/s, world axes, about the camera's centre.

  /// A pinhole camera from lens and sensor, as USD describes it; fy = fx.
  DIORAMA_SDK_API static Camera from_lens(int width, int height, double focal_length_mm,
                                          double horizontal_aperture_mm);
};

/// The one projection that renderer, annotators and writers share.
/// Pixel coordinates of a point in camera space; may lie outside the image. Nothing for points on
/// or behind the camera plane (pinhole models), beyond the lens's angle (fisheye), or where the
/// distortion folds the picture over.
DIORAMA_SDK_API std::optional<Vec2> project(const Camera& camera, const Vec3& point_camera);

/// Unit direction in camera space of the ray through a pixel coordinate; inverse of project().
/// Nothing where the lens images nothing.
DIORAMA_SDK_API std::optional<Vec3> ray_direction(const Camera& camera, const Vec2& pixel);

}  // namespace diorama
