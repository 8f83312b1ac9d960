// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/scene.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// What UsdPhysics says, as bodies and colliders. Masses are in kilograms: of the prim, or of its
/// density and the volume of the meshes at and below it.
class PhysicsTranslator {
 public:
  PhysicsTranslator(usd::Stage& stage, Scene& scene);

  /// Call when everything below the prim is in the scene.
  void translate(const usd::Prim& prim, NodeId node);

 private:
  void add_body(const usd::Prim& prim, NodeId node);
  void add_collider(const usd::Prim& prim, NodeId node);
  /// In kg/m^3; zero where nothing is said.
  double density(const usd::Prim& prim) const;
  /// Of the closed meshes at and below a node, in m^3.
  double volume(NodeId node) const;
  const usd::Prim* physics_material(const usd::Prim& prim) const;

  usd::Stage& stage_;
  Scene& scene_;
  double kilograms_per_unit_;
  double meters_per_unit_;
};

}  // namespace diorama::loader_usd
