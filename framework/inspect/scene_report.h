// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// What a loaded file holds, for people (text) and programs (JSON).
struct SceneReport {
  struct NodeLine {
    std::string path;
    std::string what;  ///< "mesh 1200 triangles", "sphere light", ...; empty for a plain group.
    int depth = 0;
    bool is_visible = true;
  };
  struct MaterialLine {
    std::string name;
    std::size_t users = 0;  ///< Nodes that carry it.
    std::vector<std::string> textures;
  };
  struct LightLine {
    std::string path;
    std::string kind;
    Vec3f color = Vec3f::Zero();
    double lux = 0.0;  ///< See lamp_lux().
  };

  std::string file;
  std::size_t nodes = 0;
  std::size_t meshes = 0;         ///< Nodes with a mesh.
  std::size_t unique_meshes = 0;  ///< Different meshes among them.
  std::size_t triangles = 0;      ///< Over all nodes, shared meshes counted each time.
  std::size_t unique_triangles = 0;
  std::size_t textures = 0;
  std::size_t texture_bytes = 0;
  std::size_t cameras = 0;
  std::size_t rigid_bodies = 0;
  std::size_t labelled = 0;
  Aabb bounds;  ///< World box of the visible meshes, metres.
  std::vector<NodeLine> tree;
  std::vector<MaterialLine> materials;  ///< By name.
  std::vector<LightLine> lights;
  std::vector<std::string> notes;     ///< What the loader said about units and the like.
  std::vector<std::string> warnings;  ///< Missing textures and references among them.
};

/// Looks at `root` and all below it.
SceneReport report_scene(const Scene& scene, NodeId root, const std::string& file);

/// The warnings that name the material in quotes: those of its missing textures among them.
std::vector<std::string> warnings_about(const SceneReport& report, const std::string& material);

/// `tree_depth` limits the tree that is printed; negative: all of it.
std::string report_text(const SceneReport& report, int tree_depth);
std::string report_json(const SceneReport& report);

}  // namespace diorama
