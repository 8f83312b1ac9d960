// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/flow.h"

#include <map>
#include <optional>

namespace diorama {
namespace {

std::uint32_t number_of(FlowState state) { return std::uint32_t(state); }

/// Whether the camera would show a point of its space at this pixel.
bool is_imaged(const Camera& camera, const Vec3& point, const Vec2& pixel) {
  const bool is_inside =
      pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < camera.width && pixel.y() < camera.height;
  // Near and far are planes, and spheres where the lens looks beside or behind them.
  const double along = -point.z();
  const double depth = along > 1e-6 * point.norm() ? along : point.norm();
  return is_inside && depth >= camera.near_m && depth <= camera.far_m;
}

}  // namespace

FlowMeter::FlowMeter(const Scene& scene, const Frame& frame, const WorldThere& world_there) {
  const auto& leaves = frame.get(kLeafId);
  const auto& positions = frame.get(kPosition);
  flow_ = Image<Vec2f>(leaves.width(), leaves.height(), Vec2f::Zero());
  states_ = Image<std::uint32_t>(leaves.width(), leaves.height(), number_of(FlowState::Unknown));
  // By leaf: from the world here to the world there; nothing for what stands still.
  std::map<std::uint32_t, std::optional<Affine>> moves;
  for (const auto& [leaf, path] : frame.leaf_paths) {
    const Affine here = scene.world_from_node(NodeId{leaf});
    const Affine there = world_there(NodeId{leaf});
    const bool stands_still = here.matrix() == there.matrix();
    moves[leaf] = stands_still ? std::nullopt : std::optional<Affine>(there * here.inverse());
  }
  const Affine camera_from_here = frame.world_from_camera.inverse();
  const Affine camera_from_there = world_there(scene.require(frame.camera_path)).inverse();
  std::uint32_t last_leaf = 0;
  const std::optional<Affine>* move = nullptr;
  for (std::size_t i = 0; i < leaves.pixels().size(); ++i) {
    const std::uint32_t leaf = leaves.pixels()[i];
    if (leaf == 0) continue;
    if (leaf != last_leaf) move = &moves.at(leaf);
    last_leaf = leaf;
    const Vec3 here = positions.pixels()[i].cast<double>();
    const Vec3 there = *move ? Vec3(**move * here) : here;
    const Vec3 in_camera = camera_from_there * there;
    const auto from = project(frame.camera, camera_from_here * here);
    const auto to = project(frame.camera, in_camera);
    states_.pixels()[i] = number_of(FlowState::Outside);
    if (!from || !to) continue;
    flow_.pixels()[i] = (*to - *from).cast<float>();
    if (!is_imaged(frame.camera, in_camera, *to)) continue;
    states_.pixels()[i] = number_of(FlowState::Hidden);
    points_.push_back(there);
    pixels_.push_back(i);
  }
}

void FlowMeter::set_seen(std::span<const std::uint8_t> seen) {
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    states_.pixels()[pixels_[i]] = number_of(seen[i] != 0 ? FlowState::Seen : FlowState::Hidden);
  }
}

}  // namespace diorama
