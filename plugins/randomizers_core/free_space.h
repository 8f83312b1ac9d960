// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/obstacles.h"
#include "diorama/scene.h"

namespace diorama {

/// Where in a scene there is room for one more thing. What a node takes is the box of its meshes
/// along its own axes.
class FreeSpace {
 public:
  /// Everything that fits `obstacles`, hidden or not, with what lies below, except for the nodes
  /// that are `to_place` and bodies that others will place.
  FreeSpace(const Scene& scene, const std::vector<std::string>& obstacles,
            const std::vector<NodeId>& to_place);

  /// Whether the node would stay `clearance_m` away from everything if it stood there.
  bool holds(const Scene& scene, NodeId node, const Affine& world_from_node,
             double clearance_m) const;
  /// The node stands where it shall stay.
  void add(const Scene& scene, NodeId node);

 private:
  Obstacles obstacles_;
};

}  // namespace diorama
