// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <urdf_model/model.h>

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "loader_support/joint_chain.h"
#include "loader_urdf/model_file.h"

namespace diorama::loader_urdf {

/// Turns a model into nodes.
class ModelTranslator {
 public:
  ModelTranslator(const urdf::ModelInterface& model, const MeshFinder& meshes, Host& host,
                  Scene& scene)
      : model_(model), meshes_(meshes), host_(host), scene_(scene) {}

  void translate(NodeId root);
  /// What could not be read, and files that are not there, one line each.
  const std::vector<std::string>& warnings() const { return warnings_; }
  const std::vector<std::string>& missing() const { return missing_; }

 private:
  struct PlacedLink {
    const urdf::Link* link;
    Affine root_from_link;
  };
  void add_links(const std::vector<PlacedLink>& order,
                 const std::vector<const urdf::Joint*>& joints, NodeId root);
  NodeId add_link(const urdf::Link& link, NodeId above, const Affine& above_from_link);
  void make_body(const urdf::Link& link, NodeId node, double unsaid_mass_kg);
  void add_joint(const urdf::Joint& joint, NodeId above);
  void add_free_joint(const urdf::Joint& joint, NodeId above,
                      const loader_support::JointEnd& parent,
                      const loader_support::JointEnd& child);
  Vec3 axis_of(const urdf::Joint& joint);
  /// The node of a shape; null when it cannot be made.
  NodeId add_geometry(const urdf::Geometry& geometry, const urdf::Pose& pose,
                      const std::string& name, NodeId link, bool is_collision);
  std::shared_ptr<const Material> material_of(const urdf::Visual& visual);
  Affine pose_of(const urdf::Pose& pose, const std::string& where);
  void warn(const std::string& text);

  const urdf::ModelInterface& model_;
  const MeshFinder& meshes_;
  Host& host_;
  Scene& scene_;
  std::map<std::string, NodeId> links_;
  std::map<std::string, NodeId> joints_;
  std::map<std::string, std::shared_ptr<const Material>> materials_;
  std::map<std::filesystem::path, std::shared_ptr<const Texture>> textures_;
  std::vector<std::string> warnings_;
  std::vector<std::string> missing_;
};

}  // namespace diorama::loader_urdf
