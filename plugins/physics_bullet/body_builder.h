// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <btBulletDynamicsCommon.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bullet_backend.h"
#include "convex_part.h"
#include "diorama/joints.h"
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
  Affine world_from_node = Affine::Identity();  ///< As it was last seen.
  Rigid node_from_object = Rigid::Identity();   ///< Of the node without its stretch.
};

struct MovingBody {
  NodeId node;
  std::string path;
  bool has_gravity = true;
  bool collides = true;
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
  NodeId node;
  JointKind kind = JointKind::Fixed;
  double scale = 1.0;                     ///< World metres per metre of a slider.
  std::optional<CompoundJoint> compound;  ///< `node` and `kind` are those of its last joint.
};

/// A joint that follows another one by a motor of its own: what hinders it does not hinder the
/// other.
struct Follower {
  std::size_t joint = 0;              ///< Index into Bodies::joints.
  std::optional<std::size_t> leader;  ///< Likewise; nothing: the leader stands still.
  double multiplier = 1.0;
  double offset = 0.0;
  double leader_position = 0.0;  ///< When it was last asked; turns count on.
};

/// What a scene holds for physics, in creation order of the nodes.
struct Bodies {
  std::vector<StaticObject> statics;
  std::vector<MovingBody> moving;
  /// What stands still, to joints: a body without mass that is in no world.
  std::unique_ptr<btRigidBody> anchor;
  std::vector<HeldJoint> joints;
  std::vector<Follower> followers;  ///< In an order in which leaders come before their followers.
  std::vector<std::string> shapeless;  ///< Rigid bodies without anything that collides.
  std::vector<std::string> unheld;     ///< Joints at the end of chains that are no compound.
};

btTransform bullet_transform(const Rigid& rigid);

Bodies build_bodies(const Scene& scene, const BulletBackend::Params& params, ShapeCache& cache);

}  // namespace diorama
