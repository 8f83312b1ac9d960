// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/clip_track.h"

#include <algorithm>

#include "diorama/error.h"

namespace diorama {

namespace {

/// A frame and its neighbours.
constexpr std::size_t kMostKept = 3;

}  // namespace

bool ClipTrack::State::operator==(const State& other) const {
  return parent_from_node.matrix() == other.parent_from_node.matrix() &&
         linear_velocity == other.linear_velocity && angular_velocity == other.angular_velocity &&
         mesh == other.mesh;
}

ClipTrack::State ClipTrack::state_of(const Node& node) {
  State state;
  state.parent_from_node = node.parent_from_node;
  state.mesh = node.mesh;
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
    if (now.mesh != wanted.mesh) scene.edit(node).mesh = wanted.mesh;
    if (!scene[node].rigid_body) continue;
    scene.set_velocity(node, wanted.linear_velocity, wanted.angular_velocity);
  }
}

Affine ClipTrack::world_from_node(const Scene& scene, NodeId node, int frame) const {
  const std::vector<State>& all = states(frame);
  Affine world_from_node = Affine::Identity();
  for (NodeId id = node; id; id = scene[id].parent) {
    world_from_node = all[place_of(id)].parent_from_node * world_from_node;
  }
  return world_from_node;
}

const std::shared_ptr<const Mesh>& ClipTrack::mesh(NodeId node, int frame) const {
  return states(frame)[place_of(node)].mesh;
}

std::size_t ClipTrack::place_of(NodeId node) const {
  return std::size_t(std::ranges::lower_bound(nodes_, node) - nodes_.begin());
}

PlayWatch::PlayWatch(const Scene& scene)
    : fixed_(fixed_of(scene)), shape_revision_(scene.shape_revision()) {
  for (const Fixed& fixed : fixed_) {
    if (scene[fixed.node].rigid_body) bodies_.push_back(fixed.node);
  }
}

void PlayWatch::begin_frame(const Scene& scene) {
  places_ = body_places(scene);
  shape_revision_ = scene.shape_revision();
  pose_revision_ = scene.pose_revision();
}

void PlayWatch::check(const Scene& scene) {
  if (scene.shape_revision() != shape_revision_) {
    shape_revision_ = scene.shape_revision();
    if (fixed_of(scene) != fixed_) {
      throw Error(ErrorKind::Plugin, "changes more than poses and meshes while a clip plays");
    }
  }
  if (scene.pose_revision() == pose_revision_) return;
  pose_revision_ = scene.pose_revision();
  if (body_places(scene) != places_) {
    throw Error(ErrorKind::Plugin, "moves rigid bodies while a clip plays");
  }
}

std::vector<PlayWatch::Fixed> PlayWatch::fixed_of(const Scene& scene) {
  std::vector<Fixed> all;
  for (const NodeId id : scene.subtree(scene.root())) {
    const Node& node = scene[id];
    all.push_back({id, node.is_visible, bool(node.mesh), node.labels, node.materials});
  }
  return all;
}

std::vector<Mat4> PlayWatch::body_places(const Scene& scene) const {
  std::vector<Mat4> places;
  places.reserve(bodies_.size());
  for (const NodeId body : bodies_) places.push_back(scene.world_from_node(body).matrix());
  return places;
}

}  // namespace diorama
