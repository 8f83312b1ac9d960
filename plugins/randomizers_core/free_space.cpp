// SPDX-License-Identifier: Apache-2.0
#include "free_space.h"

#include <set>

namespace diorama {

FreeSpace::FreeSpace(const Scene& scene, const std::vector<std::string>& obstacles,
                     const std::vector<NodeId>& to_place)
    : obstacles_(scene, {}, Obstacles::Hidden::Count) {
  std::set<NodeId> known;
  const auto leave_out = [&](const std::vector<NodeId>& nodes) {
    for (const NodeId node : nodes) {
      for (const NodeId below : scene.subtree(node)) known.insert(below);
    }
  };
  leave_out(to_place);
  leave_out(unplaced_bodies(scene));
  for (const std::string& pattern : obstacles) {
    for (const NodeId node : scene.match(pattern)) {
      for (const NodeId below : scene.subtree(node)) {
        if (!known.insert(below).second || !scene[below].mesh) continue;
        obstacles_.add(scene, below, Obstacles::Hidden::Count);
      }
    }
  }
}

bool FreeSpace::holds(const Scene& scene, NodeId node, const Affine& world_from_node,
                      double clearance_m) const {
  Aabb box = node_bounds(scene, node);
  if (box.is_empty()) box.add(Vec3::Zero());
  const Vec3 scale = world_from_node.linear().colwise().norm();
  const Vec3 margin = clearance_m * scale.cwiseMax(1e-9).cwiseInverse();
  const Vec3 centre = world_from_node * box.centre();
  box.min -= margin;
  box.max += margin;
  return !obstacles_.meets_box(box, world_from_node) && !obstacles_.encloser(centre);
}

void FreeSpace::add(const Scene& scene, NodeId node) {
  obstacles_.add(scene, node, Obstacles::Hidden::Count);
}

}  // namespace diorama
