// SPDX-License-Identifier: Apache-2.0
#include "body_builder.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "diorama/error.h"
#include "diorama/joints.h"
#include "joint_builder.h"

namespace diorama {

btTransform bullet_transform(const Rigid& rigid) {
  const Quat rotation(rigid.linear());
  const Vec3 position = rigid.translation();
  return btTransform(btQuaternion(rotation.x(), rotation.y(), rotation.z(), rotation.w()),
                     btVector3(position.x(), position.y(), position.z()));
}

namespace {

/// The colliders that move as one.
struct Group {
  std::vector<NodeId> colliders;
};

struct Census {
  std::vector<NodeId> statics;
  std::map<NodeId, Group> groups;  ///< Keyed by the rigid body's node.
};

void count_subtree(const Scene& scene, NodeId id, NodeId body, bool with_hidden, Census& census) {
  const Node& node = scene[id];
  if (!with_hidden && !node.is_visible) return;
  if (node.rigid_body) {
    body = id;
    census.groups[id];
  }
  if (node.collider) {
    if (body) {
      census.groups[body].colliders.push_back(id);
    } else {
      census.statics.push_back(id);
    }
  }
  for (const NodeId child : node.children) count_subtree(scene, child, body, with_hidden, census);
}

void check_collider(const Scene& scene, NodeId id) {
  const Collider& collider = *scene[id].collider;
  const bool is_sound = std::isfinite(collider.friction) && collider.friction >= 0.0 &&
                        collider.restitution >= 0.0 && collider.restitution <= 1.0 &&
                        collider.primitive_size.allFinite() &&
                        collider.primitive_size.minCoeff() >= 0.0;
  if (is_sound) return;
  throw Error(ErrorKind::Asset,
              scene.path(id) +
                  ": its collider needs a friction of 0 or more, a restitution in "
                  "[0, 1] and a size of 0 or more");
}

/// Bullet multiplies the values of two bodies; the root makes their geometric mean of it.
void set_surface(btCollisionObject& object, const Collider& collider) {
  object.setFriction(std::sqrt(collider.friction));
  object.setRestitution(std::sqrt(collider.restitution));
}

OwnedShapes own_shapes(const std::vector<ConvexPart>& parts, const Rigid& body_from_frame,
                       double margin_m) {
  OwnedShapes owned;
  owned.outer_margin_m = kInfinity;
  std::vector<btTransform> places;
  bool is_placed = false;
  for (const ConvexPart& part : parts) {
    PlacedShape placed = make_shape(part, body_from_frame, margin_m);
    const bool is_identity = placed.body_from_shape.matrix().isIdentity(1e-9);
    is_placed = is_placed || !is_identity;
    places.push_back(is_identity ? btTransform::getIdentity()
                                 : bullet_transform(placed.body_from_shape));
    owned.outer_margin_m = std::min(owned.outer_margin_m, placed.outer_margin_m);
    owned.parts.push_back(std::move(placed.shape));
  }
  if (parts.size() == 1 && !is_placed) return owned;
  owned.compound = std::make_unique<btCompoundShape>(true, int(parts.size()));
  owned.compound->setMargin(0.0);
  for (std::size_t i = 0; i < owned.parts.size(); ++i) {
    owned.compound->addChildShape(places[i], owned.parts[i].get());
  }
  return owned;
}

void add_static(const Scene& scene, NodeId id, const BulletBackend::Params& params,
                ShapeCache& cache, std::vector<StaticObject>& statics) {
  const Node& node = scene[id];
  const RigidStretch split = split_rigid(scene.world_from_node(id));
  StaticObject made;
  made.node = id;
  made.path = scene.path(id);
  Rigid place = split.rigid;
  if (node.collider->shape == ColliderShape::TriangleMesh && node.mesh) {
    made.shapes.mesh = cache.static_mesh(node.mesh, split.stretch);
    if (!made.shapes.mesh->shape) return;
    made.shapes.outer_margin_m = params.margin_m;
  } else {
    const auto parts = convex_parts(node, split, cache, std::size_t(params.hull_vertices));
    if (parts.empty()) return;
    place = parts.front().frame_from_part;
    made.shapes = own_shapes(parts, place.inverse(), params.margin_m);
  }
  made.object = std::make_unique<btCollisionObject>();
  made.object->setCollisionShape(made.shapes.shape());
  made.object->setWorldTransform(bullet_transform(place));
  made.world_from_node = scene.world_from_node(id);
  made.node_from_object = split.rigid.inverse() * place;
  made.object->setUserPointer(const_cast<StaticMesh*>(made.shapes.mesh.get()));
  set_surface(*made.object, *node.collider);
  statics.push_back(std::move(made));
}

struct Balance {
  Rigid frame_from_body = Rigid::Identity();  ///< Origin at the centre of mass, axes principal.
  Vec3 inertia = Vec3::Ones();
};

Balance balance_of(const MassProperties& mass, double mass_kg, const Mat3& preferred_axes) {
  Balance balance;
  const Mat3 inertia = preferred_axes.transpose() * mass.inertia(mass_kg) * preferred_axes;
  Mat3 axes = preferred_axes;
  balance.inertia = inertia.diagonal();
  const double off =
      std::max({std::abs(inertia(0, 1)), std::abs(inertia(0, 2)), std::abs(inertia(1, 2))});
  if (off > 1e-6 * inertia.trace()) {
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia);
    Mat3 turn = solver.eigenvectors();
    if (turn.determinant() < 0.0) turn.col(0) = -turn.col(0);
    axes = preferred_axes * turn;
    balance.inertia = solver.eigenvalues();
  }
  // A needle's inertia about its axis would make the solver's angular impulses explode.
  balance.inertia = balance.inertia.cwiseMax(1e-3 * balance.inertia.maxCoeff());
  balance.frame_from_body = to_rigid(axes, mass.centroid);
  return balance;
}

/// Bullet's rolling friction is a lever in metres, multiplied by the other body's friction.
double rolling_lever(const BulletBackend::Params& params, const btCollisionShape& shape) {
  btVector3 centre;
  btScalar radius = 0.0;
  shape.getBoundingSphere(centre, radius);
  return params.rolling_friction * radius;
}

void set_motion(const MovingBody& moving, double inner_radius_m,
                const BulletBackend::Params& params) {
  btRigidBody& body = *moving.body;
  if (moving.has_gravity) {
    body.setDamping(params.linear_damping, params.angular_damping);
  } else {
    body.setDamping(params.floating_damping, params.floating_damping);
    body.setFlags(body.getFlags() | BT_DISABLE_WORLD_GRAVITY);
    body.setGravity(btVector3(0.0, 0.0, 0.0));
  }
  body.setSleepingThresholds(params.sleep_speed, 5.0 * params.sleep_speed);
  const double lever = rolling_lever(params, *body.getCollisionShape());
  body.setRollingFriction(lever);
  body.setSpinningFriction(lever);
  if (params.ccd && inner_radius_m > 0.0) {
    body.setCcdMotionThreshold(0.5 * inner_radius_m);
    body.setCcdSweptSphereRadius(0.8 * inner_radius_m);
  }
}

bool has_body_above(const Scene& scene, NodeId id) {
  for (NodeId up = scene[id].parent; up; up = scene[up].parent) {
    if (scene[up].rigid_body) return true;
  }
  return false;
}

std::vector<ConvexPart> parts_of(const Scene& scene, const Group& group,
                                 const BulletBackend::Params& params, ShapeCache& cache) {
  std::vector<ConvexPart> parts;
  for (const NodeId id : group.colliders) {
    const RigidStretch split = split_rigid(scene.world_from_node(id));
    for (ConvexPart& part :
         convex_parts(scene[id], split, cache, std::size_t(params.hull_vertices))) {
      parts.push_back(std::move(part));
    }
  }
  return parts;
}

double checked_mass(const Scene& scene, NodeId id) {
  const double mass_kg = scene[id].rigid_body->mass_kg;
  if (std::isfinite(mass_kg) && mass_kg > 0.0) return mass_kg;
  throw Error(ErrorKind::Asset, scene.path(id) + ": the mass of its rigid body is " +
                                    std::to_string(mass_kg) + " kg; it must be above 0");
}

/// Bodies that joints hold, which therefore move even where nothing can touch them.
std::set<NodeId> jointed_bodies(const Scene& scene) {
  std::set<NodeId> bodies;
  for (const NodeId joint : joints_of(scene)) {
    for (NodeId node : {scene[joint].joint->parent_body, scene[joint].joint->child_body}) {
      while (node && !scene[node].rigid_body) node = scene[node].parent;
      if (node) bodies.insert(node);
    }
  }
  return bodies;
}

/// Moves by its joints and weight alone.
void add_untouchable(const Scene& scene, NodeId id, double mass_kg,
                     const BulletBackend::Params& params, Bodies& bodies) {
  constexpr double kRadius = 0.05;  // metres: how hard it is to turn
  MovingBody moving;
  moving.node = id;
  moving.path = scene.path(id);
  moving.is_nested = has_body_above(scene, id);
  moving.has_gravity = scene[id].rigid_body->has_gravity;
  moving.collides = false;
  moving.shapes.parts.push_back(std::make_unique<btSphereShape>(kRadius));
  const Rigid place = split_rigid(scene.world_from_node(id)).rigid;
  moving.start = bullet_transform(place);
  moving.body_from_node = Affine(place.inverse()) * scene.world_from_node(id);
  btRigidBody::btRigidBodyConstructionInfo info(
      mass_kg, nullptr, moving.shapes.shape(),
      btVector3(1, 1, 1) * (0.4 * mass_kg * kRadius * kRadius));
  info.m_startWorldTransform = moving.start;
  moving.body = std::make_unique<btRigidBody>(info);
  set_motion(moving, 0.0, params);
  bodies.moving.push_back(std::move(moving));
}

void add_moving(const Scene& scene, NodeId id, const Group& group,
                const BulletBackend::Params& params, ShapeCache& cache, bool is_jointed,
                Bodies& bodies) {
  const double mass_kg = checked_mass(scene, id);
  const std::vector<ConvexPart> parts = parts_of(scene, group, params, cache);
  if (parts.empty() && is_jointed) return add_untouchable(scene, id, mass_kg, params, bodies);
  if (parts.empty()) {
    bodies.shapeless.push_back(scene.path(id));
    return;
  }
  MassProperties mass;
  double inner_radius_m = kInfinity;
  for (const ConvexPart& part : parts) {
    mass = combined(mass, part.mass);
    inner_radius_m = std::min(inner_radius_m, part.inner_radius_m);
  }
  const Balance balance = balance_of(mass, mass_kg, parts.front().frame_from_part.linear());

  MovingBody moving;
  moving.node = id;
  moving.path = scene.path(id);
  moving.is_nested = has_body_above(scene, id);
  moving.has_gravity = scene[id].rigid_body->has_gravity;
  moving.shapes = own_shapes(parts, balance.frame_from_body.inverse(), params.margin_m);
  moving.start = bullet_transform(balance.frame_from_body);
  moving.body_from_node = Affine(balance.frame_from_body.inverse()) * scene.world_from_node(id);
  btRigidBody::btRigidBodyConstructionInfo info(
      mass_kg, nullptr, moving.shapes.shape(),
      btVector3(balance.inertia.x(), balance.inertia.y(), balance.inertia.z()));
  info.m_startWorldTransform = moving.start;
  moving.body = std::make_unique<btRigidBody>(info);
  set_surface(*moving.body, *scene[group.colliders.front()].collider);
  set_motion(moving, inner_radius_m, params);
  bodies.moving.push_back(std::move(moving));
}

}  // namespace

btCollisionShape* OwnedShapes::shape() const {
  if (mesh) return mesh->shape.get();
  if (compound) return compound.get();
  return parts.front().get();
}

Bodies build_bodies(const Scene& scene, const BulletBackend::Params& params, ShapeCache& cache) {
  Census census;
  count_subtree(scene, scene.root(), NodeId{}, params.hidden_collide, census);
  Bodies bodies;
  for (const NodeId id : census.statics) {
    check_collider(scene, id);
    add_static(scene, id, params, cache, bodies.statics);
  }
  const std::set<NodeId> jointed = jointed_bodies(scene);
  for (const auto& [id, group] : census.groups) {
    for (const NodeId collider : group.colliders) check_collider(scene, collider);
    add_moving(scene, id, group, params, cache, jointed.contains(id), bodies);
  }
  add_joints(scene, bodies);
  return bodies;
}

}  // namespace diorama
