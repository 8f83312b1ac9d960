// SPDX-License-Identifier: Apache-2.0
#include "free_placement.h"

#include "diorama/node_pattern.h"

#include <algorithm>
#include <set>

#include "collision_world.h"
#include "diorama/obstacles.h"

namespace diorama {
namespace {

/// Obstacles that are neither moved nor below a node that is, nor wait to be placed by others.
void add_obstacles(const PlacementParams& params, const std::vector<NodeId>& moved,
                   const Scene& scene, CollisionWorld& world) {
  std::set<NodeId> known;
  const auto leave_out = [&](const std::vector<NodeId>& nodes) {
    for (const NodeId node : nodes) {
      for (const NodeId below : scene.subtree(node)) known.insert(below);
    }
  };
  leave_out(moved);
  leave_out(unplaced_bodies(scene));
  for (const std::string& pattern : params.obstacles) {
    for (const NodeId node : scene.match(pattern)) {
      if (known.contains(node)) continue;
      // What a pattern finds again below this node is in already.
      for (const NodeId below : scene.subtree(node)) known.insert(below);
      CollisionBody body(scene, node);
      if (body.has_shape()) world.add(std::move(body), Vec3::Zero());
    }
  }
}

void move(Scene& scene, NodeId node, const Vec3& shift) {
  const Affine parent_from_world = scene.world_from_node(scene[node].parent).inverse();
  scene.set_pose(node,
                 parent_from_world * Eigen::Translation3d(shift) * scene.world_from_node(node));
}

Aabb box_of(const Scene& scene, NodeId node, const CollisionBody& body) {
  if (body.has_shape()) return body.bounds_world();
  const Vec3 place = scene.world_from_node(node).translation();
  return {place, place};
}

}  // namespace

void PlacementParams::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to place.", kNodePattern});
  v.param("avoid_overlap", avoid_overlap,
          {"Draw again while a node would meet an obstacle or one placed before it."});
  v.param("obstacles", obstacles,
          {"Nodes that must not be met, with all below them.", kNodePattern});
  v.param("max_tries", max_tries, {"Draws per node at most.", "", 1, 100000});
}

void place_freely(const PlacementParams& params, const DrawShift& draw, const Rng& rng,
                  Scene& scene, Host& host) {
  const std::vector<NodeId> nodes = scene.match(params.nodes);
  CollisionWorld world;
  if (params.avoid_overlap) add_obstacles(params, nodes, scene, world);
  for (const NodeId node : nodes) {
    CollisionBody body(scene, node);
    const Aabb box = box_of(scene, node, body);
    Rng draws = rng.fork(scene.path(node));
    Vec3 shift = draw(box, draws);
    bool is_free = !params.avoid_overlap || world.is_free(body, shift);
    for (int tries = 1; !is_free && tries < params.max_tries; ++tries) {
      shift = draw(box, draws);
      is_free = world.is_free(body, shift);
    }
    if (!is_free) {
      host.log(LogLevel::Warning, scene.path(node) + ": no free place in " +
                                      std::to_string(params.max_tries) +
                                      " tries, so it meets something");
    }
    move(scene, node, shift);
    if (params.avoid_overlap && body.has_shape()) world.add(std::move(body), shift);
  }
}

}  // namespace diorama
