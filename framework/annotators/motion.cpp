// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/motion.h"

#include <optional>
#include <vector>

namespace diorama {
namespace {

/// Maps world points of a node to where they were; nothing when it stood still.
std::optional<Affine> before_from_now(const Scene& scene, const BodyPoses& before, NodeId node) {
  while (node && !scene[node].rigid_body) node = scene[node].parent;
  const auto pose = node ? before.find(node) : before.end();
  if (pose == before.end()) return std::nullopt;
  const Affine now = scene.world_from_node(node);
  if (pose->second.matrix() == now.matrix()) return std::nullopt;
  return pose->second * now.inverse();
}

/// By leaf id: from a world point now to the camera's space before. Empty where neither the leaf
/// nor the camera moved.
std::vector<std::optional<Affine>> earlier_views(const Scene& scene, const BodyPoses& before,
                                                 const Frame& frame) {
  const NodeId camera = scene.require(frame.camera_path);
  const std::optional<Affine> camera_motion = before_from_now(scene, before, camera);
  Affine world_from_camera = frame.world_from_camera;
  if (camera_motion) world_from_camera = *camera_motion * world_from_camera;
  const Affine camera_from_world = world_from_camera.inverse();
  std::vector<std::optional<Affine>> views;
  for (const auto& [leaf, path] : frame.leaf_paths) {
    const auto moved = before_from_now(scene, before, NodeId{leaf});
    if (!moved && !camera_motion) continue;
    if (leaf >= views.size()) views.resize(leaf + 1);
    views[leaf] = camera_from_world * moved.value_or(Affine::Identity());
  }
  return views;
}

}  // namespace

BodyPoses body_poses(const Scene& scene) {
  BodyPoses poses;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (scene[node].rigid_body) poses.emplace(node, scene.world_from_node(node));
  }
  return poses;
}

void measure_motion(const Scene& scene, const BodyPoses& before, Frame& frame) {
  const auto& leaves = frame.get(kLeafId);
  const auto& positions = frame.get(kPosition);
  const auto views = earlier_views(scene, before, frame);
  const Affine camera_from_world = frame.world_from_camera.inverse();
  Image<Vec2f> motion(leaves.width(), leaves.height(), Vec2f::Zero());
  for (std::size_t i = 0; i < leaves.pixels().size(); ++i) {
    const std::uint32_t leaf = leaves.pixels()[i];
    if (leaf >= views.size() || !views[leaf]) continue;
    const Vec3 point = positions.pixels()[i].cast<double>();
    const auto now = project(frame.camera, camera_from_world * point);
    const auto earlier = project(frame.camera, *views[leaf] * point);
    if (now && earlier) motion.pixels()[i] = (*now - *earlier).cast<float>();
  }
  frame.set(kMotion, std::move(motion));
}

}  // namespace diorama
