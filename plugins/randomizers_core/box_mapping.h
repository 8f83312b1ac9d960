// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>

#include "diorama/geometry.h"
#include "diorama/material.h"
#include "diorama/scene.h"

namespace diorama {

/// Gives meshes without uv coordinates some: each triangle is seen along the axis that it faces
/// most, and a unit of uv is a unit of the mesh's own space.
class BoxMapping {
 public:
  /// The same triangles in the same order, with uv coordinates; positions are doubled where
  /// triangles that face different ways meet. A mesh is mapped once while its result is in use.
  std::shared_ptr<const Mesh> mapped(const std::shared_ptr<const Mesh>& mesh);

  /// Gives the node a mesh with uv coordinates if it has none. Returns how often a picture has to
  /// be repeated along them to measure `picture_m` in the world; 1 where the mesh has its own.
  float fit(Scene& scene, NodeId node, double picture_m);

 private:
  bool is_own(const std::shared_ptr<const Mesh>& mesh) const;

  struct Entry {
    std::weak_ptr<const Mesh> source;
    std::weak_ptr<const Mesh> mapped;
  };
  std::map<const Mesh*, Entry> by_source_;
  std::map<const Mesh*, std::weak_ptr<const Mesh>> own_;  ///< Meshes made here.
};

/// All of its textures, so many times along the mesh's uv as they were.
void repeat_textures(Material& material, float times);

}  // namespace diorama
