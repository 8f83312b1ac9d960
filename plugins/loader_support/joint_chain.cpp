// SPDX-License-Identifier: Apache-2.0
#include "loader_support/joint_chain.h"

namespace diorama::loader_support {

bool add_joint(Scene& scene, NodeId node, std::vector<Joint> axes,
               const std::vector<std::string>& names, const JointEnd& parent,
               const JointEnd& child) {
  // Frames have the size of the asset, so that its metres count.
  const Affine world_from_joint = scene.world_from_node(parent.body) * parent.body_from_joint;
  const Affine world_from_child = scene.world_from_node(child.body) * child.body_from_joint;
  const Affine node_from_joint = scene.world_from_node(node).inverse() * world_from_joint;
  if (!world_from_joint.matrix().allFinite() || !world_from_child.matrix().allFinite()) {
    return false;
  }
  if (axes.size() > 1 && !node_from_joint.matrix().allFinite()) return false;
  axes.front().parent_body = parent.body;
  axes.front().parent_from_joint = parent.body_from_joint;
  axes.back().child_body = child.body;
  axes.back().child_from_joint = child.body_from_joint;
  if (axes.size() == 1) {
    scene.edit(node).joint = axes.front();
    return true;
  }
  NodeId frame;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const NodeId id = scene.create(node, names[i]);
    scene.set_pose(id, node_from_joint);
    if (frame) axes[i].parent_body = frame;
    if (i + 1 < axes.size()) axes[i].child_body = id;
    scene.edit(id).joint = axes[i];
    frame = id;
  }
  return true;
}

}  // namespace diorama::loader_support
