// SPDX-License-Identifier: Apache-2.0
#include "sampling.h"

namespace diorama {

NodeDraws draws_for(const Scene& scene, NodeId node, std::size_t position, std::size_t count,
                    const RandomizeContext& context, const Rng& rng) {
  return {rng.fork(scene.path(node)),
          std::uint64_t(context.occurrence) * std::uint64_t(count) + std::uint64_t(position)};
}

void set_world_pose(Scene& scene, NodeId node, const Affine& world_from_node) {
  const Affine world_from_parent = scene.world_from_node(scene[node].parent);
  scene.set_pose(node, world_from_parent.inverse() * world_from_node);
}

std::vector<Vec3> centres_of(const Scene& scene, const std::vector<NodeId>& nodes) {
  std::vector<Vec3> centres;
  for (const NodeId node : nodes) {
    const Aabb box = scene.world_bounds(node);
    centres.push_back(box.is_empty() ? Vec3(scene.world_from_node(node).translation())
                                     : box.centre());
  }
  return centres;
}

std::vector<Vec3> target_centres(const Scene& scene, const std::string& pattern,
                                 const Vec3& fallback) {
  std::vector<Vec3> centres = centres_of(scene, scene.match(pattern));
  if (centres.empty()) centres.push_back(fallback);
  return centres;
}

}  // namespace diorama
