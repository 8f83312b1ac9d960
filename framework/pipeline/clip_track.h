// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// Where everything in a scene is in the last frames of a clip: as many as one frame and those
/// beside it need, so that a clip takes the same memory whatever its length.
class ClipTrack {
 public:
  /// Adds the scene as it is now as the next frame. Its nodes are those of the first frame. Of what
  /// was added before, the last two frames are kept.
  void add(const Scene& scene);
  /// Frames added so far.
  int size() const { return added_; }

  /// Puts everything where it is in one of the frames kept; touches only what is elsewhere.
  void show(int frame, Scene& scene) const;
  /// Where a node is in the world in one of the frames kept, whichever frame the scene shows.
  Affine world_from_node(const Scene& scene, NodeId node, int frame) const;

 private:
  struct State {
    Affine parent_from_node = Affine::Identity();
    Vec3 linear_velocity = Vec3::Zero();
    Vec3 angular_velocity = Vec3::Zero();
    bool operator==(const State& other) const;
  };
  static State state_of(const Node& node);
  const std::vector<State>& states(int frame) const;

  std::vector<NodeId> nodes_;            ///< Ascending.
  std::deque<std::vector<State>> kept_;  ///< By frame, then as `nodes_`; ends with the last one.
  std::vector<std::uint8_t> has_moved_;  ///< As `nodes_`: since the first frame.
  int added_ = 0;
};

}  // namespace diorama
