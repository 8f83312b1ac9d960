// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>

#include "diorama/scene.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// Whether the type of a prim is a joint that scenes can hold, or one that they cannot.
bool is_joint(const std::string& type_name);
bool is_foreign_joint(const std::string& type_name);

/// One axis along or about which a joint is free, and where its limits are said.
struct FreeAxis {
  std::string name;  ///< "transX" ... "rotZ"; nothing where a joint has only this one.
  JointKind kind = JointKind::Revolute;
  Vec3 axis = Vec3::UnitX();
  double lower = -kInfinity, upper = kInfinity;  ///< As the file says them, in its units.
};

/// Reads UsdPhysics joints into nodes that were made for them.
class JointTranslator {
 public:
  using Note = std::function<void(const usd::Prim&, const std::string& what, const std::string&)>;
  using Nodes = std::map<const usd::Prim*, NodeId>;

  /// `world`: the node of the asset, which stays where it is put, and in which the stage is
  /// `world_from_stage`. `stage`, `scene` and `nodes` must outlive it.
  JointTranslator(usd::Stage& stage, Scene& scene, NodeId world, const Affine& world_from_stage,
                  const Nodes& nodes, Note note)
      : stage_(stage),
        scene_(scene),
        world_(world),
        world_from_stage_(world_from_stage),
        nodes_(nodes),
        note_(std::move(note)) {}

  /// Joints of several axes become a chain of joints below the node, named after the axes.
  /// `meters_per_unit` of the layer that says the joint's limits. All bodies have their poses.
  void translate(const usd::Prim& prim, NodeId node, double meters_per_unit);

 private:
  struct Side {
    NodeId body;
    Affine world_from_joint = Affine::Identity();
    bool is_world = false;
    bool is_known = true;
  };

  Side side(const usd::Prim& prim, char number);
  NodeId world_body();
  NodeId body_at_or_above(const usd::Prim& prim) const;
  Joint joint_of(const usd::Prim& prim, const FreeAxis& free, double meters_per_unit);

  usd::Stage& stage_;
  Scene& scene_;
  NodeId world_;
  NodeId world_body_;  ///< Null: no joint is held to the world so far.
  Affine world_from_stage_;
  const Nodes& nodes_;
  Note note_;
};

}  // namespace diorama::loader_usd
