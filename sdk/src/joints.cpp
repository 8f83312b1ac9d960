// SPDX-License-Identifier: Apache-2.0
#include "diorama/joints.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <set>

namespace diorama {
namespace {

constexpr double kSamePose = 1e-13;

Affine motion(const Joint& joint, double position) {
  Affine moved = Affine::Identity();
  if (joint.kind == JointKind::Revolute) {
    moved.linear() = Eigen::AngleAxisd(position, joint.axis).toRotationMatrix();
  } else if (joint.kind == JointKind::Prismatic) {
    moved.translation() = position * joint.axis;
  }
  return moved;
}

/// The one of the equal turns that the limits allow.
double turn_within(const Joint& joint, double angle) {
  constexpr double kTurn = 2.0 * kPi;
  constexpr double kSlack = 1e-9;
  if (angle < joint.lower - kSlack && std::isfinite(joint.lower)) {
    const double turned = angle + kTurn * std::ceil((joint.lower - kSlack - angle) / kTurn);
    if (turned <= joint.upper + kSlack) return turned;
  } else if (angle > joint.upper + kSlack && std::isfinite(joint.upper)) {
    const double turned = angle - kTurn * std::ceil((angle - joint.upper - kSlack) / kTurn);
    if (turned >= joint.lower - kSlack) return turned;
  }
  return angle;
}

/// Targets and what mimics them, at any distance.
std::map<NodeId, double> all_targets(const Scene& scene, const std::vector<NodeId>& joints,
                                     std::span<const JointTarget> targets) {
  std::map<NodeId, double> positions;
  for (const JointTarget& target : targets) {
    if (scene.contains(target.joint) && scene[target.joint].joint) {
      positions[target.joint] = target.position;
    }
  }
  std::map<NodeId, std::vector<NodeId>> followers;
  for (const NodeId id : joints) {
    if (const auto& mimic = scene[id].joint->mimic) followers[mimic->joint].push_back(id);
  }
  std::set<NodeId> done;
  std::deque<NodeId> waiting;
  for (const auto& [id, position] : positions) {
    const auto& mimic = scene[id].joint->mimic;
    // What follows another target comes after it.
    if (!mimic || !positions.contains(mimic->joint)) waiting.push_back(id);
  }
  while (!waiting.empty()) {
    const NodeId id = waiting.front();
    waiting.pop_front();
    if (!done.insert(id).second) continue;
    for (const NodeId follower : followers[id]) {
      if (done.contains(follower)) continue;
      const Joint::Mimic& mimic = *scene[follower].joint->mimic;
      positions[follower] = mimic.multiplier * positions[id] + mimic.offset;
      waiting.push_back(follower);
    }
  }
  std::erase_if(positions, [](const auto& entry) { return !std::isfinite(entry.second); });
  return positions;
}

}  // namespace

std::vector<NodeId> joints_of(const Scene& scene) {
  std::vector<NodeId> joints;
  for (const NodeId id : scene.subtree(scene.root())) {
    const auto& joint = scene[id].joint;
    if (joint && scene.contains(joint->parent_body) && scene.contains(joint->child_body)) {
      joints.push_back(id);
    }
  }
  std::sort(joints.begin(), joints.end());
  return joints;
}

double joint_position(const Scene& scene, NodeId id) {
  const Joint& joint = *scene[id].joint;
  if (joint.kind == JointKind::Fixed) return 0.0;
  const Affine moved =
      (scene.world_from_node(joint.parent_body) * joint.parent_from_joint).inverse() *
      scene.world_from_node(joint.child_body) * joint.child_from_joint;
  if (joint.kind == JointKind::Prismatic) return joint.axis.dot(moved.translation());
  const Quat turn = Transform::from_affine(moved).rotation;
  // The twist about the axis; a swing beside it does not count.
  const double angle = 2.0 * std::atan2(joint.axis.dot(turn.vec()), turn.w());
  return turn_within(joint, std::remainder(angle, 2.0 * kPi));
}

std::vector<JointState> joint_states(const Scene& scene) {
  std::vector<JointState> states;
  for (const NodeId id : joints_of(scene)) {
    const Joint& joint = *scene[id].joint;
    states.push_back({scene.path(id), joint.kind, scene.path(joint.parent_body),
                      scene.path(joint.child_body), joint_position(scene, id), joint.lower,
                      joint.upper});
  }
  return states;
}

void pose_joints(Scene& scene, std::span<const JointTarget> targets) {
  const std::vector<NodeId> joints = joints_of(scene);
  const std::map<NodeId, double> positions = all_targets(scene, joints, targets);
  if (positions.empty()) return;

  // Where every body is, and which joints leave it.
  std::map<NodeId, Affine> before;
  std::map<NodeId, std::vector<NodeId>> leaving;
  std::set<NodeId> children;
  for (const NodeId id : joints) {
    const Joint& joint = *scene[id].joint;
    for (const NodeId body : {joint.parent_body, joint.child_body}) {
      if (!before.contains(body)) before.emplace(body, scene.world_from_node(body));
    }
    if (joint.parent_body == joint.child_body) continue;
    leaving[joint.parent_body].push_back(id);
    children.insert(joint.child_body);
  }

  // Where it will be, from what nothing holds on.
  std::map<NodeId, Affine> after;
  std::deque<NodeId> waiting;
  for (const auto& [body, pose] : before) {
    if (children.contains(body)) continue;
    after.emplace(body, pose);
    waiting.push_back(body);
  }
  while (!waiting.empty()) {
    const NodeId parent = waiting.front();
    waiting.pop_front();
    const Affine world_from_parent = after.at(parent);
    for (const NodeId id : leaving[parent]) {
      const Joint& joint = *scene[id].joint;
      if (after.contains(joint.child_body)) continue;
      const auto target = positions.find(id);
      if (target != positions.end() && joint.kind != JointKind::Fixed) {
        after.emplace(joint.child_body, world_from_parent * joint.parent_from_joint *
                                            motion(joint, target->second) *
                                            joint.child_from_joint.inverse());
      } else {
        after.emplace(joint.child_body, world_from_parent * before.at(parent).inverse() *
                                            before.at(joint.child_body));
      }
      waiting.push_back(joint.child_body);
    }
  }

  // Bodies may be nodes below each other, whichever holds which: parents of the tree first.
  std::vector<NodeId> order;
  for (const NodeId id : scene.subtree(scene.root())) {
    if (after.contains(id)) order.push_back(id);
  }
  for (const NodeId body : order) {
    const Affine& wanted = after.at(body);
    if (scene.world_from_node(body).isApprox(wanted, kSamePose)) continue;
    const Affine world_from_above =
        body == scene.root() ? Affine::Identity() : scene.world_from_node(scene[body].parent);
    scene.set_pose(body, world_from_above.inverse() * wanted);
  }
}

}  // namespace diorama
