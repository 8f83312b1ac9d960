// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "diorama/material.h"
#include "diorama/math.h"

namespace diorama {

enum class LightKind : std::uint8_t { Sphere, Rect, Disk, Distant, Dome };

/// A light of a node. Sizes are in node space (the node's scale counts); rect, disk and distant
/// lights shine along the node's -z. A dome surrounds everything; its texture is an
/// equirectangular image whose top row is the node's +z and whose centre column lies at the node's
/// +x, with the image's right half towards -y (seen from inside, as photographed).
struct Light {
  LightKind kind = LightKind::Sphere;
  /// Sphere, rect, disk: luminance of the surface, nits (cd/m^2). Dome: nits of a texel of value 1,
  /// or of the whole dome without a texture. Distant: illuminance of a surface facing it, in lux.
  Vec3f color = Vec3f::Ones();
  double radius_m = 0.1;                   ///< Sphere, disk.
  double width_m = 1.0;                    ///< Rect, along x.
  double height_m = 1.0;                   ///< Rect, along y.
  double angle_rad = 0.0093;               ///< Distant: full angular diameter.
  std::shared_ptr<const Texture> texture;  ///< Dome only.
  /// Shaping: no light beyond this half angle from -z; kPi: no cone.
  double cone_angle_rad = kPi;
  double cone_softness = 0.0;  ///< Share of the cone over which it fades, in [0, 1].
  bool is_visible_to_camera = true;
};

}  // namespace diorama
