// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "diorama/geometry.h"
#include "loader_assimp/scene_file.h"
#include "loader_support/mesh_pool.h"

namespace diorama::loader_assimp {

/// Makes one mesh with several material slots out of the meshes of a node. Nodes with the same or
/// equal meshes share the result.
class MeshTranslator {
 public:
  explicit MeshTranslator(const SceneFile& file) : file_(file) {}

  /// Null for a node without triangles. Slots are numbered as in slots().
  std::shared_ptr<const Mesh> translate(const aiNode& node);

  /// The material of each slot, as numbers of the scene's materials.
  std::vector<unsigned> slots(const aiNode& node) const;

 private:
  std::vector<const aiMesh*> meshes_of(const aiNode& node) const;
  void append(const aiMesh& source, const aiNode& node, std::uint16_t slot, Mesh& mesh) const;
  bool multiplies_by_vertex_colors(const aiMesh& source) const;

  /// The node counts where bones move the points.
  using Key = std::pair<std::vector<const aiMesh*>, const aiNode*>;
  const SceneFile& file_;
  std::map<Key, std::shared_ptr<const Mesh>> meshes_;
  loader_support::MeshPool pool_;
};

}  // namespace diorama::loader_assimp
