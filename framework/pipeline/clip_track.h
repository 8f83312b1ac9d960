// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// Where everything in a scene is in every frame of a clip.
class ClipTrack {
 public:
  /// Adds the scene as it is now as the next frame. Its nodes are those of the first frame.
  void add(const Scene& scene);
  int size() const { return int(changed_.size()); }

  /// Puts everything where it is in a frame; touches only what is elsewhere.
  void show(int frame, Scene& scene) const;
  /// Where a node is in the world in a frame, whichever frame the scene shows.
  Affine world_from_node(const Scene& scene, NodeId node, int frame) const;

 private:
  struct State {
    Affine parent_from_node = Affine::Identity();
    Vec3 linear_velocity = Vec3::Zero();
    Vec3 angular_velocity = Vec3::Zero();
    bool operator==(const State& other) const;
  };
  static State state_of(const Node& node);
  const State& at(NodeId node, int frame) const;

  std::map<NodeId, State> first_;                 ///< Of every node, in the first frame.
  std::vector<std::map<NodeId, State>> changed_;  ///< By frame: what differs from the first one.
  std::vector<NodeId> moving_;                    ///< Nodes that differ in some frame.
};

}  // namespace diorama
