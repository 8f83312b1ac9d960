// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/clip_track.h"

#include <algorithm>

namespace diorama {

namespace {

/// A frame and its neighbours.
constexpr std::size_t kMostKept = 3;

}  // namespace

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
  if (added_ == 0) {
    nodes_ = scene.subtree(scene.root());
    std::ranges::sort(nodes_);
    has_moved_.assign(nodes_.size(), 0);
  }
  std::vector<State> now;
  now.reserve(nodes_.size());
  for (const NodeId node : nodes_) now.push_back(state_of(scene[node]));
  for (std::size_t i = 0; added_ > 0 && i < nodes_.size(); ++i) {
    if (has_moved_[i] == 0 && !(now[i] == kept_.back()[i])) has_moved_[i] = 1;
  }
  if (kept_.size() == kMostKept) kept_.pop_front();
  kept_.push_back(std::move(now));
  ++added_;
}

const std::vector<ClipTrack::State>& ClipTrack::states(int frame) const {
  return kept_.at(kept_.size() - std::size_t(added_ - frame));
}

void ClipTrack::show(int frame, Scene& scene) const {
  const std::vector<State>& all = states(frame);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (has_moved_[i] == 0) continue;
    const NodeId node = nodes_[i];
    const State& wanted = all[i];
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
  const std::vector<State>& all = states(frame);
  Affine world_from_node = Affine::Identity();
  for (NodeId id = node; id; id = scene[id].parent) {
    const auto place = std::ranges::lower_bound(nodes_, id) - nodes_.begin();
    world_from_node = all[std::size_t(place)].parent_from_node * world_from_node;
  }
  return world_from_node;
}

}  // namespace diorama
