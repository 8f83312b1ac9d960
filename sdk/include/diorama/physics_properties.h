// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "diorama/math.h"

namespace diorama {

enum class ColliderShape : std::uint8_t {
  TriangleMesh,  ///< Exact, static bodies only; a moving body gets its convex hull.
  ConvexHull,
  BoundingBox,  ///< Of the mesh in node space.
  BoundingSphere,
  /// The exact primitive when the node was made from one, see Collider::primitive.
  Primitive,
};

enum class PrimitiveShape : std::uint8_t { None, Box, Sphere, Cylinder, Cone, Capsule };

/// Makes the mesh of its node (or `primitive`) collide. A node whose ancestor (or itself) has a
/// RigidBody moves with the nearest one; otherwise it is static.
struct Collider {
  ColliderShape shape = ColliderShape::ConvexHull;
  PrimitiveShape primitive = PrimitiveShape::None;
  Vec3 primitive_size = Vec3::Ones();  ///< Size of its bounding box in node space; axis along z.
  double friction = 0.5;
  double restitution = 0.0;
};

/// Poses of the node (and all below it) follow the simulation.
struct RigidBody {
  double mass_kg = 1.0;
  bool has_gravity = true;
  Vec3 linear_velocity = Vec3::Zero();   ///< m/s, world, of the node's origin; written back.
  Vec3 angular_velocity = Vec3::Zero();  ///< rad/s, world; written back by the backend.
};

}  // namespace diorama
