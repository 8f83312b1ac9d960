// SPDX-License-Identifier: Apache-2.0
#include "diorama/joints.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <utility>

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

/// Axes of frames are unit lengths or sums of such by rounding.
constexpr double kSameAxis = 1e-6;

bool is_frame(const Scene& scene, NodeId id) { return scene[id].joint->child_body == id; }

/// The column that `axis` is along, with its sign; nothing when it is between them.
struct Column {
  int index = 0;
  double sign = 1.0;
};
std::optional<Column> column_of(const Mat3& axes, const Vec3& axis) {
  const Vec3 parts = axes.transpose() * axis;
  Column column;
  const double most = parts.cwiseAbs().maxCoeff(&column.index);
  if (!(std::abs(most - 1.0) <= kSameAxis)) return std::nullopt;
  column.sign = parts[column.index] > 0.0 ? 1.0 : -1.0;
  return column;
}

Vec3 beside(const Vec3& axis) { return axis.unitOrthogonal(); }

/// CompoundJoint::axes for turns and slides about and along these; nothing when there are none.
std::optional<Mat3> common_axes(const std::vector<Vec3>& turns, const std::vector<Vec3>& slides) {
  if (turns.size() > 3 || slides.size() > 3) return std::nullopt;
  Mat3 axes;
  if (turns.size() == 2) {
    // Nothing turns about the middle one, so that no angle of the others is ambiguous.
    axes.col(2) = turns[0];
    axes.col(0) = turns[1];
    axes.col(1) = axes.col(2).cross(axes.col(0));
  } else {
    axes.col(2) = turns.empty() ? slides[0] : turns[0];
    if (turns.size() == 3) {
      axes.col(1) = turns[1];
    } else {
      axes.col(1) = beside(axes.col(2));
      for (const Vec3& slide : slides) {
        if (std::abs(slide.dot(axes.col(2))) > kSameAxis) continue;
        axes.col(1) = slide;
        break;
      }
    }
    axes.col(0) = axes.col(1).cross(axes.col(2));
  }
  if (!(axes.transpose() * axes).isIdentity(kSameAxis)) return std::nullopt;
  for (const auto* list : {&turns, &slides}) {
    std::set<int> taken;
    for (const Vec3& axis : *list) {
      const auto column = column_of(axes, axis);
      if (!column || !taken.insert(column->index).second) return std::nullopt;
    }
  }
  return axes;
}

std::optional<CompoundJoint> compound_of(const Scene& scene, std::vector<NodeId> joints) {
  std::vector<Vec3> turns;
  std::vector<Vec3> slides;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const Joint& joint = *scene[joints[i]].joint;
    if (joint.kind == JointKind::Fixed) return std::nullopt;
    if (joint.kind == JointKind::Prismatic && !turns.empty()) return std::nullopt;
    (joint.kind == JointKind::Prismatic ? slides : turns).push_back(joint.axis);
    if (i + 1 == joints.size()) continue;
    const Affine between =
        joint.child_from_joint.inverse() * scene[joints[i + 1]].joint->parent_from_joint;
    if (!between.matrix().isIdentity(kSameAxis)) return std::nullopt;
  }
  const auto axes = common_axes(turns, slides);
  if (!axes) return std::nullopt;
  return CompoundJoint{std::move(joints), *axes};
}

/// Where a body of the chain is to its first joint.
Affine entry_from(const Scene& scene, const Joint& first) {
  return scene.world_from_node(first.parent_body) * first.parent_from_joint;
}

/// Angles about the third, second and first axis.
Vec3 turns_of(const Mat3& turned) {
  const double swing = std::asin(std::clamp(-turned(2, 0), -1.0, 1.0));
  const bool is_upright = std::hypot(turned(2, 1), turned(2, 2)) < 1e-9;
  if (is_upright) return {std::atan2(-turned(0, 1), turned(1, 1)), swing, 0.0};
  return {std::atan2(turned(1, 0), turned(0, 0)), swing, std::atan2(turned(2, 1), turned(2, 2))};
}

/// How far the first two of three angles are from where joints stand; the third is of the body,
/// which has moved before its frames.
double way_from(const std::vector<double>& standing, const Vec3& angles,
                const std::vector<double>& signs) {
  double sum = 0.0;
  for (const int i : {0, 1}) {
    const std::size_t at = std::size_t(i);
    sum += std::abs(std::remainder(signs[at] * angles[i] - standing[at], 2.0 * kPi));
  }
  return sum;
}

/// How far the angles are beyond limits.
double beyond(const Vec3& angles, const std::vector<const Joint*>& turns,
              const std::vector<double>& signs) {
  double sum = 0.0;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const int at = turns.size() == 2 && i == 1 ? 2 : int(i);
    const double angle = turn_within(*turns[i], signs[i] * std::remainder(angles[at], 2.0 * kPi));
    sum += std::max({0.0, turns[i]->lower - angle, angle - turns[i]->upper});
  }
  return sum;
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

std::vector<CompoundJoint> compound_joints(const Scene& scene) {
  const std::vector<NodeId> joints = joints_of(scene);
  std::map<NodeId, std::vector<NodeId>> leaving;  // frames
  for (const NodeId id : joints) {
    const NodeId parent = scene[id].joint->parent_body;
    if (parent != id && scene[parent].joint && is_frame(scene, parent)) {
      leaving[parent].push_back(id);
    }
  }
  // Those of a chain are placed together, and neither lead nor follow others.
  std::set<NodeId> mimics;
  for (const NodeId id : joints) {
    if (const auto& mimic = scene[id].joint->mimic) mimics.insert({id, mimic->joint});
  }
  std::vector<CompoundJoint> compounds;
  for (const NodeId id : joints) {
    if (is_frame(scene, id)) continue;
    std::vector<NodeId> chain{id};
    while (true) {
      const NodeId above = scene[chain.front()].joint->parent_body;
      const auto frame = leaving.find(above);
      if (frame == leaving.end() || frame->second.size() != 1 || chain.size() > 6) break;
      chain.insert(chain.begin(), above);
    }
    const bool is_alone =
        std::ranges::none_of(chain, [&](NodeId part) { return mimics.contains(part); });
    if (chain.size() < 2 || !is_alone) continue;
    if (auto compound = compound_of(scene, std::move(chain))) {
      compounds.push_back(std::move(*compound));
    }
  }
  return compounds;
}

void place_frames(Scene& scene, const CompoundJoint& compound) {
  const Joint& first = *scene[compound.joints.front()].joint;
  const Joint& last = *scene[compound.joints.back()].joint;
  const Affine world_from_entry = entry_from(scene, first);
  const Affine moved =
      world_from_entry.inverse() * scene.world_from_node(last.child_body) * last.child_from_joint;
  if (!moved.matrix().allFinite()) return;
  const Mat3& axes = compound.axes;
  const Mat3 turned =
      axes.transpose() * Transform::from_affine(moved).rotation.toRotationMatrix() * axes;
  std::vector<const Joint*> turns;
  std::vector<double> standing;
  std::vector<double> signs;
  for (const NodeId id : compound.joints) {
    const Joint& joint = *scene[id].joint;
    if (joint.kind != JointKind::Revolute) continue;
    turns.push_back(&joint);
    standing.push_back(joint_position(scene, id));
    signs.push_back(column_of(axes, joint.axis).value_or(Column{}).sign);
  }
  // Beyond a quarter turn of the middle one of three there is another answer.
  Vec3 angles = turns_of(turned);
  const Vec3 other(angles[0] + kPi, kPi - angles[1], angles[2] + kPi);
  if (turns.size() == 3) {
    // Limits tell which, else the frames as they stand: nothing jumps.
    const double gain = beyond(angles, turns, signs) - beyond(other, turns, signs);
    const bool is_nearer =
        way_from(standing, other, signs) + 1e-9 < way_from(standing, angles, signs);
    if (gain > 1e-9 || (gain > -1e-9 && is_nearer)) angles = other;
  }
  Affine world_from_joint = world_from_entry;
  std::size_t turn = 0;
  for (std::size_t i = 0; i + 1 < compound.joints.size(); ++i) {
    const NodeId id = compound.joints[i];
    const Joint& joint = *scene[id].joint;
    double position = joint.axis.dot(moved.translation());
    if (joint.kind == JointKind::Revolute) {
      position = signs[turn] * angles[turns.size() == 2 && turn == 1 ? 2 : int(turn)];
      ++turn;
    }
    world_from_joint = world_from_joint * motion(joint, position);
    const Affine wanted = world_from_joint * joint.child_from_joint.inverse();
    if (scene.world_from_node(id).isApprox(wanted, kSamePose)) continue;
    const Affine above_from_frame = scene.world_from_node(scene[id].parent).inverse() * wanted;
    if (above_from_frame.matrix().allFinite()) scene.set_pose(id, above_from_frame);
  }
}

}  // namespace diorama
