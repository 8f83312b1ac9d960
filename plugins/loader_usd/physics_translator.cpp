// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/physics_translator.h"

#include <algorithm>
#include <cmath>

#include "loader_usd/conversion.h"
#include "loader_usd/usd/geometry.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;
using usd::Stage;

PrimitiveShape primitive_of(const std::string& type) {
  if (type == "Cube") return PrimitiveShape::Box;
  if (type == "Sphere") return PrimitiveShape::Sphere;
  if (type == "Cylinder") return PrimitiveShape::Cylinder;
  if (type == "Cone") return PrimitiveShape::Cone;
  if (type == "Capsule") return PrimitiveShape::Capsule;
  return PrimitiveShape::None;
}

ColliderShape collider_shape(const std::string& approximation) {
  if (approximation == "boundingCube") return ColliderShape::BoundingBox;
  if (approximation == "boundingSphere") return ColliderShape::BoundingSphere;
  if (approximation == "convexHull" || approximation == "convexDecomposition" ||
      approximation == "sphereFill") {
    return ColliderShape::ConvexHull;
  }
  return ColliderShape::TriangleMesh;
}

bool is_positive(double number) { return number > 0.0 && std::isfinite(number); }

double mesh_volume(const Mesh& mesh, const Affine& map) {
  double six_volumes = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 pa = map * mesh.positions[a].cast<double>();
    const Vec3 pb = map * mesh.positions[b].cast<double>();
    const Vec3 pc = map * mesh.positions[c].cast<double>();
    six_volumes += pa.dot(pb.cross(pc));
  }
  return std::abs(six_volumes) / 6.0;
}

}  // namespace

PhysicsTranslator::PhysicsTranslator(Stage& stage, Scene& scene)
    : stage_(stage), scene_(scene), meters_per_unit_(stage.meters_per_unit()) {
  const usd::Layer& layer = stage.root_layer();
  const double stated = layer.get(layer.root(), "kilogramsPerUnit").as_number().value_or(1.0);
  kilograms_per_unit_ = is_positive(stated) ? stated : 1.0;
  if (!is_positive(meters_per_unit_)) meters_per_unit_ = 0.01;
}

void PhysicsTranslator::translate(const Prim& prim, NodeId node) {
  prims_[node] = &prim;
  const bool is_body = usd::has_schema(stage_, prim, "PhysicsRigidBodyAPI") &&
                       usd::bool_or(stage_, prim, "physics:rigidBodyEnabled", true) &&
                       !usd::bool_or(stage_, prim, "physics:kinematicEnabled", false);
  if (is_body) add_body(prim, node);
  const bool collides = usd::has_schema(stage_, prim, "PhysicsCollisionAPI") && scene_[node].mesh &&
                        usd::bool_or(stage_, prim, "physics:collisionEnabled", true);
  if (collides) add_collider(prim, node);
}

PhysicsTranslator::Statement PhysicsTranslator::statement(NodeId node) const {
  Statement result;
  const auto found = prims_.find(node);
  if (found == prims_.end()) return result;
  const Prim& prim = *found->second;
  const auto positive = [&](const Prim& of, const char* name) {
    const double number = usd::number_or(stage_, of, name, 0.0);
    return is_positive(number) ? number * kilograms_per_unit_ : 0.0;
  };
  const double per_cubic_metre = 1.0 / std::pow(meters_per_unit_, 3.0);
  result.mass_kg = positive(prim, "physics:mass");
  result.density = positive(prim, "physics:density") * per_cubic_metre;
  const Prim* material = scene_[node].mesh ? physics_material(prim) : nullptr;
  if (material) result.material_density = positive(*material, "physics:density") * per_cubic_metre;
  return result;
}

void PhysicsTranslator::add_body(const Prim& prim, NodeId node) {
  RigidBody body;
  body.has_gravity = !usd::bool_or(stage_, prim, "physxRigidBody:disableGravity", false);
  const double mass = mass_below(node, 0.0);
  if (is_positive(mass)) body.mass_kg = mass;
  // Velocities are said in the space that the prim stands in; root prims turn and scale the stage.
  Affine world_from_parent = scene_.world_from_node(scene_[node].parent);
  if (prim.parent && !prim.parent->parent) {
    if (!stage_.is_z_up()) world_from_parent = world_from_parent * z_up_from_y_up();
    world_from_parent.linear() *= meters_per_unit_;
  }
  if (const auto v = usd::vector3(stage_, prim, "physics:velocity")) {
    body.linear_velocity = world_from_parent.linear() * Vec3((*v)[0], (*v)[1], (*v)[2]);
  }
  if (const auto w = usd::vector3(stage_, prim, "physics:angularVelocity")) {
    const Vec3 radians = Vec3((*w)[0], (*w)[1], (*w)[2]) * (kPi / 180.0);
    body.angular_velocity = Transform::from_affine(world_from_parent).rotation * radians;
  }
  if (!body.linear_velocity.allFinite()) body.linear_velocity.setZero();
  if (!body.angular_velocity.allFinite()) body.angular_velocity.setZero();
  scene_.edit(node).rigid_body = body;
}

// A mass counts for all that is below it, a density for what says no other one.
double PhysicsTranslator::mass_below(NodeId node, double density) const {
  const Statement said = statement(node);
  if (said.mass_kg > 0.0) return said.mass_kg;
  if (said.density > 0.0) density = said.density;
  double mass = 0.0;
  const Node& content = scene_[node];
  const double own_density = density > 0.0 ? density : said.material_density;
  // Volumes take time, and few files say a density.
  if (content.mesh && own_density > 0.0) {
    mass += own_density * mesh_volume(*content.mesh, scene_.world_from_node(node));
  }
  for (const NodeId child : content.children) {
    if (!scene_[child].rigid_body) mass += mass_below(child, density);
  }
  return mass;
}

// Bound for physics or for all purposes, to the prim or to what is above it.
const Prim* PhysicsTranslator::physics_material(const Prim& prim) const {
  for (const Prim* at = &prim; at; at = at->parent) {
    usd::Strings bound = stage_.targets(*at, "material:binding:physics");
    if (bound.empty()) bound = stage_.targets(*at, "material:binding");
    const Prim* material = bound.size() == 1 ? stage_.find(bound.front()) : nullptr;
    if (material && usd::has_schema(stage_, *material, "PhysicsMaterialAPI")) return material;
  }
  return nullptr;
}

void PhysicsTranslator::add_collider(const Prim& prim, NodeId node) {
  Collider collider;
  const PrimitiveShape primitive = primitive_of(prim.type_name);
  const bool is_upright = usd::token_or(stage_, prim, "axis", "Z") == "Z";
  if (prim.type_name == "Mesh") {
    collider.shape = collider_shape(usd::token_or(stage_, prim, "physics:approximation", "none"));
  } else if (primitive != PrimitiveShape::None && is_upright) {
    collider.shape = ColliderShape::Primitive;
    collider.primitive = primitive;
    collider.primitive_size = scene_[node].mesh->bounds().size();
  }
  if (const Prim* material = physics_material(prim)) {
    collider.friction = usd::number_or(stage_, *material, "physics:dynamicFriction", 0.5);
    collider.restitution = usd::number_or(stage_, *material, "physics:restitution", 0.0);
  }
  scene_.edit(node).collider = collider;
}

}  // namespace diorama::loader_usd
