// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "loader_assimp/file_space.h"
#include "loader_assimp/material_translator.h"
#include "loader_assimp/mesh_translator.h"
#include "loader_assimp/scene_file.h"

namespace diorama::loader_assimp {

/// Turns a file into nodes, one per node of the file, in metres and Z up. A root node that holds
/// nothing itself is left out; units and axes stand in the poses of the nodes below.
class SceneTranslator {
 public:
  SceneTranslator(const SceneFile& file, const UnstatedSpace& unstated, Host& host, Scene& scene);

  /// Adds the file's nodes below `root`.
  void translate(NodeId root);

  /// One line per missing texture.
  std::vector<std::string> missing() const { return materials_.missing(); }

 private:
  struct Place {
    NodeId node;
    Affine root_from_node = Affine::Identity();
  };
  /// What stands at a node besides its meshes.
  struct Fittings {
    const aiLight* light = nullptr;
    const aiCamera* camera = nullptr;
  };

  void find_fittings();
  void translate_node(const aiNode& source, const Place& parent, const Affine& parent_from_node,
                      int depth);
  void translate_children(const aiNode& source, const Place& place, const Affine& place_from_node,
                          int depth);
  void add_shape(const aiNode& source, NodeId node);
  void add_fittings(const aiNode& source, const Place& parent, const Place& place);
  NodeId stand(const Affine& node_from_thing, const char* name, bool is_alone, const Place& parent,
               const Place& place);

  const SceneFile& file_;
  Scene& scene_;
  MeshTranslator meshes_;
  MaterialTranslator materials_;
  Affine root_from_top_;
  std::map<const aiNode*, Fittings> fittings_;
};

}  // namespace diorama::loader_assimp
