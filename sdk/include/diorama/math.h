// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>

#include "diorama/abi.h"

/// Metres, radians, right-handed, world Z up. Column vectors: point_a = a_from_b * point_b.
/// Camera space: x right, y up, looking along -z. Pixel (0,0) is top left, its centre at (0.5,
/// 0.5).
namespace diorama {

static_assert(EIGEN_MAX_ALIGN_BYTES == 16, "link diorama::sdk, it pins Eigen's alignment");

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Vec2f = Eigen::Vector2f;
using Vec3f = Eigen::Vector3f;
using Quat = Eigen::Quaterniond;
using Mat3 = Eigen::Matrix3d;
using Mat4 = Eigen::Matrix4d;
using Affine = Eigen::Affine3d;

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A local pose: scale, then rotate, then translate. Products of these may shear, so they are
/// Affine.
struct Transform {
  Vec3 translation = Vec3::Zero();
  Quat rotation = Quat::Identity();
  Vec3 scale = Vec3::Ones();

  DIORAMA_SDK_API Affine affine() const;
  /// Splits an affine map by polar decomposition; shear, which a Transform cannot hold, is lost. A
  /// mirrored map gets a negative x scale.
  DIORAMA_SDK_API static Transform from_affine(const Affine& map);
};

/// An axis-aligned box; empty (min > max) until a point is added.
struct Aabb {
  Vec3 min = Vec3::Constant(kInfinity);
  Vec3 max = Vec3::Constant(-kInfinity);

  bool is_empty() const { return !(min.array() <= max.array()).all(); }
  Vec3 centre() const { return 0.5 * (min + max); }
  Vec3 size() const { return max - min; }
  DIORAMA_SDK_API void add(const Vec3& point);
  DIORAMA_SDK_API void add(const Aabb& box);
  /// The box of the eight mapped corners; empty stays empty.
  DIORAMA_SDK_API Aabb mapped(const Affine& map) const;
  /// Corner i in [0, 8): bit 0 picks max x, bit 1 max y, bit 2 max z.
  DIORAMA_SDK_API Vec3 corner(int i) const;
};

/// The rotation that turns camera space so that -z points along `forward` and x stays level
/// (perpendicular to `up`). `forward` need not be unit length; when it is parallel to `up`, +y of
/// the world serves as up (+z when it is parallel to that, too). Throws Error when it is zero.
DIORAMA_SDK_API Quat look_rotation(const Vec3& forward, const Vec3& up = Vec3::UnitZ());

}  // namespace diorama
