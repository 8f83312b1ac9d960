// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/clip_track.h"

#include <algorithm>

namespace diorama {

bool ClipTrack::State::operator==(const State& other) const {
  return parent_from_node.matrix() == other.parent_from_node.matrix() &&
         linear_velocity == other.linear_velocity && angular_velocity == other.angular_velocity;
}

ClipTrack::State ClipTrack::state_of(const Node& node) {
  State state{node.parent_from_node};
  if (node.rigid_body) {
    state.linear_velocity = node.rigid_body->linear_velocity;
    state.angular_velocity = node.rigid_body->angular_velocity;
  }
  return state;
}

void ClipTrack::add(const Scene& scene) {
  auto& changed = changed_.emplace_back();
  for (const NodeId node : scene.subtree(scene.root())) {
    const State state = state_of(scene[node]);
    if (changed_.size() == 1) {
      first_.emplace(node, state);
      continue;
    }
    if (state == first_.at(node)) continue;
    changed.emplace(node, state);
    const auto place = std::ranges::lower_bound(moving_, node);
    if (place == moving_.end() || *place != node) moving_.insert(place, node);
  }
}

const ClipTrack::State& ClipTrack::at(NodeId node, int frame) const {
  const auto& changed = changed_[std::size_t(frame)];
  const auto found = changed.find(node);
  return found != changed.end() ? found->second : first_.at(node);
}

void ClipTrack::show(int frame, Scene& scene) const {
  for (const NodeId node : moving_) {
    const State& wanted = at(node, frame);
    const State now = state_of(scene[node]);
    if (now == wanted) continue;
    if (now.parent_from_node.matrix() != wanted.parent_from_node.matrix()) {
      scene.set_pose(node, wanted.parent_from_node);
    }
    if (!scene[node].rigid_body) continue;
    scene.set_velocity(node, wanted.linear_velocity, wanted.angular_velocity);
  }
}

Affine ClipTrack::world_from_node(const Scene& scene, NodeId node, int frame) const {
  Affine world_from_node = Affine::Identity();
  for (NodeId id = node; id; id = scene[id].parent) {
    world_from_node = at(id, frame).parent_from_node * world_from_node;
  }
  return world_from_node;
}

}  // namespace diorama
