// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/physics_translator.h"

#include <algorithm>
#include <cmath>

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

bool has_schema(const Stage& stage, const Prim& prim, std::string_view name) {
  const usd::Strings schemas = stage.metadata_list(prim, "apiSchemas");
  return std::find(schemas.begin(), schemas.end(), name) != schemas.end();
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
  const bool is_body = has_schema(stage_, prim, "PhysicsRigidBodyAPI") &&
                       usd::bool_or(stage_, prim, "physics:rigidBodyEnabled", true) &&
                       !usd::bool_or(stage_, prim, "physics:kinematicEnabled", false);
  if (is_body) add_body(prim, node);
  const bool collides = has_schema(stage_, prim, "PhysicsCollisionAPI") && scene_[node].mesh &&
                        usd::bool_or(stage_, prim, "physics:collisionEnabled", true);
  if (collides) add_collider(prim, node);
}

void PhysicsTranslator::add_body(const Prim& prim, NodeId node) {
  RigidBody body;
  body.has_gravity = !usd::bool_or(stage_, prim, "physxRigidBody:disableGravity", false);
  const double stated = usd::number_or(stage_, prim, "physics:mass", 0.0) * kilograms_per_unit_;
  const double dense = is_positive(stated) ? 0.0 : density(prim);
  // Volumes take time, and few files say a density.
  const double computed = is_positive(dense) ? dense * volume(node) : 0.0;
  if (is_positive(stated)) {
    body.mass_kg = stated;
  } else if (is_positive(computed)) {
    body.mass_kg = computed;
  }
  scene_.edit(node).rigid_body = body;
}

double PhysicsTranslator::density(const Prim& prim) const {
  double stated = usd::number_or(stage_, prim, "physics:density", 0.0);
  const Prim* material = is_positive(stated) ? nullptr : physics_material(prim);
  if (material) stated = usd::number_or(stage_, *material, "physics:density", 0.0);
  if (!is_positive(stated)) return 0.0;
  return stated * kilograms_per_unit_ / std::pow(meters_per_unit_, 3.0);
}

double PhysicsTranslator::volume(NodeId node) const {
  double sum = 0.0;
  for (const NodeId part : scene_.subtree(node)) {
    const Node& content = scene_[part];
    if (content.mesh) sum += mesh_volume(*content.mesh, scene_.world_from_node(part));
  }
  return sum;
}

// Bound for physics or for all purposes, to the prim or to what is above it.
const Prim* PhysicsTranslator::physics_material(const Prim& prim) const {
  for (const Prim* at = &prim; at; at = at->parent) {
    usd::Strings bound = stage_.targets(*at, "material:binding:physics");
    if (bound.empty()) bound = stage_.targets(*at, "material:binding");
    const Prim* material = bound.size() == 1 ? stage_.find(bound.front()) : nullptr;
    if (material && has_schema(stage_, *material, "PhysicsMaterialAPI")) return material;
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
