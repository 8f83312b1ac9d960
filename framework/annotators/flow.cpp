// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/flow.h"

#include <map>
#include <memory>
#include <optional>

#include "framework/annotators/triangle_grid.h"

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

/// Takes points of a leaf from the world here to the world there.
class LeafMove {
 public:
  LeafMove(const Scene& scene, NodeId leaf, const FlowMeter::There& there)
      : there_(there), here_(scene[leaf].mesh) {
    const Affine world_from_here = scene.world_from_node(leaf);
    here_from_world_ = world_from_here.inverse();
    there_from_here_ = there.world_from_node * here_from_world_;
    stands_still_ = world_from_here.matrix() == there.world_from_node.matrix();
    bends_ = here_ != there_.mesh;
    const bool has_same_triangles =
        here_ && there_.mesh && here_->triangles.size() == there_.mesh->triangles.size();
    if (bends_ && has_same_triangles) grid_.emplace(*here_);
  }

  /// Nothing: it is not known.
  std::optional<Vec3> of(const Vec3& point) const {
    if (!bends_) return stands_still_ ? point : Vec3(there_from_here_ * point);
    const auto place = grid_ ? grid_->place_of(here_from_world_ * point) : std::nullopt;
    if (!place) return std::nullopt;
    const auto& corners = there_.mesh->triangles[place->triangle];
    Vec3 in_node = Vec3::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      in_node += place->weights[k] * there_.mesh->positions[corners[k]].cast<double>();
    }
    return Vec3(there_.world_from_node * in_node);
  }

 private:
  Affine here_from_world_;
  Affine there_from_here_;  ///< In world space.
  FlowMeter::There there_;
  std::shared_ptr<const Mesh> here_;
  bool stands_still_ = false;
  bool bends_ = false;
  std::optional<TriangleGrid> grid_;
};

}  // namespace

FlowMeter::FlowMeter(const Scene& scene, const Frame& frame, const NodeThere& node_there) {
  const auto& leaves = frame.get(kLeafId);
  const auto& positions = frame.get(kPosition);
  flow_ = Image<Vec2f>(leaves.width(), leaves.height(), Vec2f::Zero());
  states_ = Image<std::uint32_t>(leaves.width(), leaves.height(), number_of(FlowState::Unknown));
  std::map<std::uint32_t, LeafMove> moves;
  for (const auto& [leaf, path] : frame.leaf_paths) {
    moves.try_emplace(leaf, scene, NodeId{leaf}, node_there(NodeId{leaf}));
  }
  const Affine camera_from_here = frame.world_from_camera.inverse();
  const Affine camera_from_there =
      node_there(scene.require(frame.camera_path)).world_from_node.inverse();
  std::uint32_t last_leaf = 0;
  const LeafMove* move = nullptr;
  for (std::size_t i = 0; i < leaves.pixels().size(); ++i) {
    const std::uint32_t leaf = leaves.pixels()[i];
    if (leaf == 0) continue;
    if (leaf != last_leaf) move = &moves.at(leaf);
    last_leaf = leaf;
    const Vec3 here = positions.pixels()[i].cast<double>();
    const std::optional<Vec3> there = move->of(here);
    if (!there) continue;
    const Vec3 in_camera = camera_from_there * *there;
    const auto from = project(frame.camera, camera_from_here * here);
    const auto to = project(frame.camera, in_camera);
    states_.pixels()[i] = number_of(FlowState::Outside);
    if (!from || !to) continue;
    flow_.pixels()[i] = (*to - *from).cast<float>();
    if (!is_imaged(frame.camera, in_camera, *to)) continue;
    states_.pixels()[i] = number_of(FlowState::Hidden);
    points_.push_back(*there);
    pixels_.push_back(i);
  }
}

void FlowMeter::set_seen(std::span<const std::uint8_t> seen) {
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    states_.pixels()[pixels_[i]] = number_of(seen[i] != 0 ? FlowState::Seen : FlowState::Hidden);
  }
}

}  // namespace diorama
