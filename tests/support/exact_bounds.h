// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/scene.h"

namespace diorama::test {

/// The world box of a node's own mesh, vertex by vertex; Scene::world_bounds maps the corners of
/// the mesh's box, which is larger for turned nodes. Falls back to it where there is no mesh.
inline Aabb exact_bounds(const Scene& scene, NodeId node) {
  if (!scene[node].mesh) return scene.world_bounds(node);
  const Affine world_from_node = scene.world_from_node(node);
  Aabb box;
  for (const Vec3f& position : scene[node].mesh->positions) {
    box.add(world_from_node * position.cast<double>());
  }
  return box;
}

}  // namespace diorama::test
