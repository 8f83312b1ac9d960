// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "diorama/camera.h"
#include "diorama/math.h"

namespace diorama::lint {

/// A camera's lens as datasets describe it, by formulas of lint's own. Camera axes here and in
/// object_checks.h: x right, y down, z forward.
struct Lens {
  enum class Model { Pinhole, Opencv, Fisheye };

  Model model = Model::Pinhole;
  int width = 0;
  int height = 0;
  Vec2 focal = Vec2::Ones();           ///< Pixels.
  Vec2 centre = Vec2::Zero();          ///< Pixels.
  std::array<double, 8> distortion{};  ///< k1 k2 p1 p2 k3 k4 k5 k6.
  std::array<double, 6> polynomial{};  ///< Angle by radius in pixels.
  double max_angle = kPi;

  /// Nothing for points that the lens does not image.
  std::optional<Vec2> pixel(const Vec3& point_camera) const;
  /// Direction of a pixel coordinate; z is 1 but for fisheyes, whose directions have length 1.
  std::optional<Vec3> direction(const Vec2& pixel) const;
};

Lens lens_of(const Camera& camera);

}  // namespace diorama::lint
