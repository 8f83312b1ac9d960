// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <btBulletDynamicsCommon.h>

#include <memory>
#include <string>
#include <vector>

#include "bullet_backend.h"
#include "convex_part.h"
#include "shape_cache.h"

namespace diorama {

/// Shapes of one collision object; the last one is what the object uses.
struct OwnedShapes {
  std::vector<std::unique_ptr<btConvexInternalShape>> parts;
  std::unique_ptr<btCompoundShape> compound;  ///< Null for a single part at the body's origin.
  std::shared_ptr<const StaticMesh> mesh;
  /// How far the shape reaches beyond the true surfaces: the least of its parts.
  double outer_margin_m = 0.0;

  btCollisionShape* shape() const;
};

struct StaticObject {
  NodeId node;
  std::string path;
  OwnedShapes shapes;
  std::unique_ptr<btCollisionObject> object;
};

struct MovingBody {
  NodeId node;
  std::string path;
  bool has_gravity = true;
  bool is_nested = false;  ///< Below another moving body: its pose in its parent changes anyway.
  OwnedShapes shapes;
  std::unique_ptr<btRigidBody> body;
  Affine body_from_node = Affine::Identity();
  btTransform start;  ///< Where it was at the last reset.
};

/// A joint between two moving bodies, or between one and what stands still.
struct HeldJoint {
  std::string path;
  std::unique_ptr<btTypedConstraint> constraint;
};

/// What a scene holds for physics, in creation order of the nodes.
struct Bodies {
  std::vector<StaticObject> statics;
  std::vector<MovingBody> moving;
  /// What stands still, to joints: a body without mass that is in no world.
  std::unique_ptr<btRigidBody> anchor;
  std::vector<HeldJoint> joints;
  std::vector<std::string> shapeless;  ///< Rigid bodies without anything that collides.
};

btTransform bullet_transform(const Rigid& rigid);

Bodies build_bodies(const Scene& scene, const BulletBackend::Params& params, ShapeCache& cache);

}  // namespace diorama
