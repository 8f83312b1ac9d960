// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/randomizer.h"

namespace diorama {

/// What is drawn for one node in one call of a randomizer.
struct NodeDraws {
  Rng rng;
  std::uint64_t index = 0;  ///< What sequences go by.

  double number(const Distribution& distribution) { return distribution.draw(rng, index); }
  Vec3 vector(const Distribution& distribution) { return distribution.draw_vector(rng, index); }
  /// One number stands for all axes.
  Vec3 scale(const Distribution& distribution) {
    return distribution.width() == 3 ? vector(distribution) : Vec3::Constant(number(distribution));
  }
  std::size_t text(const TextDistribution& distribution) { return distribution.draw(rng, index); }
};

/// The draws of the node at `position` among `count` nodes of a call. Streams are keyed by path, so
/// that one more node leaves the draws of the others as they were; sequences go from node to node.
NodeDraws draws_for(const Scene& scene, NodeId node, std::size_t position, std::size_t count,
                    const RandomizeContext& context, const Rng& rng);

/// Calls body(node, draws) for each of the nodes.
template <class Body>
void draw_for_each(const Scene& scene, const std::vector<NodeId>& nodes,
                   const RandomizeContext& context, const Rng& rng, const Body& body) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    NodeDraws draws = draws_for(scene, nodes[i], i, nodes.size(), context, rng);
    body(nodes[i], draws);
  }
}

/// Nodes that fit the pattern and for which is_wanted(Node) holds.
template <class IsWanted>
std::vector<NodeId> match_if(const Scene& scene, const std::string& pattern,
                             const IsWanted& is_wanted) {
  std::vector<NodeId> nodes = scene.match(pattern);
  std::erase_if(nodes, [&](NodeId node) { return !is_wanted(scene[node]); });
  return nodes;
}

/// Sets the node's pose from one in the world, whatever its ancestors' poses are.
void set_world_pose(Scene& scene, NodeId node, const Affine& world_from_node);

/// Centres of the boxes of the nodes; of those without a mesh, their places.
std::vector<Vec3> centres_of(const Scene& scene, const std::vector<NodeId>& nodes);

/// Those of the nodes that fit; `fallback` alone when none fits.
std::vector<Vec3> target_centres(const Scene& scene, const std::string& pattern,
                                 const Vec3& fallback);

constexpr double radians(double degrees) { return degrees * kPi / 180.0; }

}  // namespace diorama
