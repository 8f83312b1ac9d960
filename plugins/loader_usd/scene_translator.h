// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "loader_usd/joint_translator.h"
#include "loader_usd/light_translator.h"
#include "loader_usd/material_translator.h"
#include "loader_usd/mesh_translator.h"
#include "loader_usd/physics_translator.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// Turns a composed stage into nodes, in metres and Z up. One node per prim that can be placed or
/// holds something that is drawn or is a joint; what else is not drawn (materials, skeletons) gets
/// none.
class SceneTranslator {
 public:
  SceneTranslator(usd::Stage& stage, Host& host, Scene& scene);

  /// Adds the stage's root prims below `root`.
  void translate(NodeId root);
  /// The length and the axis that the stage was taken to mean.
  std::string describe_units() const;

 private:
  struct Place {
    NodeId node;
    Affine root_from_node = Affine::Identity();
  };

  /// What a layer says about its units and axis, if it does and can be believed.
  struct Metrics {
    std::optional<double> meters_per_unit;
    std::optional<bool> is_z_up;
  };

  Metrics metrics_of(const usd::Layer& layer) const;
  void translate_children(const usd::Prim& prim, const Place& place);
  void translate_prim(const usd::Prim& prim, const Place& parent, const Affine& parent_from_placed);
  std::vector<const usd::Prim*> drawn_children(const usd::Prim& prim);
  bool is_drawn(const usd::Prim& prim);
  Affine local_pose(const usd::Prim& prim, const Place& parent);
  Affine unit_correction(const usd::Prim& prim) const;

  Affine finite_pose(const usd::Prim& prim, const Affine& pose);
  std::string drawn_material(const usd::Prim& prim);
  void add_shape(const usd::Prim& prim, const Place& place);
  void add_camera(const usd::Prim& prim, Place& place);
  void add_light(const usd::Prim& prim, Place& place);
  double stage_scale(const Place& place) const;
  bool has_z_pole(const usd::Prim& dome) const;
  void add_labels(const usd::Prim& prim, NodeId node);
  void add_joints(NodeId root);
  void add_instances(const usd::Prim& prim, const Place& place);
  void note(const usd::Prim& prim, const std::string& what, const std::string& detail = {});
  void note_undrawn(const usd::Prim& prim, const std::string& type);
  void report_notes();
  void finish_materials();
  std::shared_ptr<const Material> plain_material(const TranslatedMesh& mesh);

  usd::Stage& stage_;
  Scene& scene_;
  usd::Geometry geometry_;
  MeshTranslator meshes_;
  MaterialTranslator materials_;
  PhysicsTranslator physics_;
  double meters_per_unit_;
  Affine root_from_stage_;
  std::map<std::pair<const usd::Prim*, bool>, bool> drawn_;  ///< Second: below a prototype.
  std::map<std::vector<float>, std::shared_ptr<const Material>> plain_materials_;
  std::vector<std::pair<NodeId, MeshLight>> mesh_lights_;
  /// Materials whose base colour is the one displayColor of a mesh.
  struct Tint {
    NodeId node;
    std::size_t slot;
    Vec3f color;
  };
  std::vector<Tint> tints_;
  /// Prims with something that the scene cannot hold.
  struct Noted {
    std::string first_path;
    std::string first_detail;
    std::size_t count = 0;
  };
  std::map<std::string, Noted> notes_;  ///< By what is said of them.
  JointTranslator::Nodes nodes_;        ///< Of prims outside of instancers.
  std::vector<std::pair<const usd::Prim*, NodeId>> joints_;
  int instancer_depth_ = 0;
  std::size_t node_count_ = 0;
};

}  // namespace diorama::loader_usd
