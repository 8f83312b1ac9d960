// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>

#include "diorama/scene.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// What UsdPhysics says, as bodies and colliders. A body's mass is what it says, or else the sum of
/// what is below it: masses, and volumes of meshes with the density of the nearest prim above them
/// that has one, or else of their physics material.
class PhysicsTranslator {
 public:
  PhysicsTranslator(usd::Stage& stage, Scene& scene);

  /// Call when everything below the prim is in the scene.
  void translate(const usd::Prim& prim, NodeId node);

 private:
  /// What MassAPI and physics materials say of a node, in SI units; zero where they say nothing.
  struct Statement {
    double mass_kg = 0.0;
    double density = 0.0;
    double material_density = 0.0;
  };

  Statement statement(NodeId node) const;
  void add_body(const usd::Prim& prim, NodeId node);
  void add_collider(const usd::Prim& prim, NodeId node);
  double mass_below(NodeId node, double density) const;
  const usd::Prim* physics_material(const usd::Prim& prim) const;

  usd::Stage& stage_;
  Scene& scene_;
  double kilograms_per_unit_;
  double meters_per_unit_;
  std::map<NodeId, const usd::Prim*> prims_;
};

}  // namespace diorama::loader_usd
