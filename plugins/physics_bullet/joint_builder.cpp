// SPDX-License-Identifier: Apache-2.0
#include "joint_builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "diorama/error.h"
#include "diorama/joints.h"

namespace diorama {
namespace {

constexpr double kFar = 1e6;  // metres: no limit

using MovingBodies = std::map<NodeId, std::size_t>;

/// The moving body that the node is part of; nothing where it stands still.
const MovingBody* body_above(const Scene& scene, NodeId node, const MovingBodies& moving,
                             const Bodies& bodies) {
  for (; node; node = scene[node].parent) {
    const auto found = moving.find(node);
    if (found != moving.end()) return &bodies.moving[found->second];
    if (scene[node].rigid_body) return nullptr;
  }
  return nullptr;
}

/// Joint space with the axis along x (sliders) or z (hinges).
Rigid turned_to_axis(const Affine& world_from_joint, const Joint& joint) {
  Rigid frame = split_rigid(world_from_joint).rigid;
  const Vec3 own = joint.kind == JointKind::Prismatic ? Vec3::UnitX() : Vec3::UnitZ();
  frame.linear() =
      frame.linear() * Quat::FromTwoVectors(own, joint.axis).normalized().toRotationMatrix();
  return frame;
}

Rigid turned_to_axes(const Affine& world_from_joint, const Mat3& axes) {
  Rigid frame = split_rigid(world_from_joint).rigid;
  frame.linear() = frame.linear() * axes;
  return frame;
}

btTransform frame_in(const MovingBody* body, const Rigid& world_from_joint) {
  const btTransform world = bullet_transform(world_from_joint);
  return body ? body->start.inverse() * world : world;
}

std::unique_ptr<btTypedConstraint> make_hinge(const Joint& joint, btRigidBody& parent,
                                              btRigidBody& child, const btTransform& in_parent,
                                              const btTransform& in_child) {
  // By the parent's frame angles count as the scene's do.
  auto hinge = std::make_unique<btHingeConstraint>(parent, child, in_parent, in_child, true);
  const double range = joint.upper - joint.lower;
  // Bullet knows angles within one turn only.
  if (range < 2.0 * kPi) hinge->setLimit(joint.lower, joint.upper, 0.9, 0.3, 0.0);
  return hinge;
}

std::unique_ptr<btTypedConstraint> make_slider(const Joint& joint, double scale,
                                               btRigidBody& parent, btRigidBody& child,
                                               const btTransform& in_parent,
                                               const btTransform& in_child) {
  auto slider = std::make_unique<btSliderConstraint>(parent, child, in_parent, in_child, true);
  slider->setLowerLinLimit(std::max(scale * joint.lower, -kFar));
  slider->setUpperLinLimit(std::min(scale * joint.upper, kFar));
  slider->setLowerAngLimit(0.0);
  slider->setUpperAngLimit(0.0);
  slider->setRestitutionLimLin(0.0);
  return slider;
}

struct Interval {
  double lower = 0.0;
  double upper = 0.0;

  double middle() const { return 0.5 * (lower + upper); }
  bool is_within(double reach) const { return lower >= -reach && upper <= reach; }
  Interval moved(double by) const { return {lower + by, upper + by}; }
  Interval mirrored() const { return {-upper, -lower}; }
};

/// Of a turn or slide of a compound, by its axes; nothing: it is free.
using Limit = std::optional<Interval>;

/// Bullet knows angles within one turn only.
Limit turn_limit(const Joint& joint, double sign) {
  if (!(joint.upper - joint.lower < 2.0 * kPi)) return std::nullopt;
  Interval limit{joint.lower, joint.upper};
  if (sign < 0.0) limit = limit.mirrored();
  return limit.moved(-2.0 * kPi * std::round(limit.middle() / (2.0 * kPi)));
}

/// What the sine of the interval's angles takes them for, in a quarter turn either way.
Interval folded(const Interval& limit) {
  const auto holds = [&](double angle) {
    return std::ceil((limit.lower - angle) / (2.0 * kPi)) <=
           std::floor((limit.upper - angle) / (2.0 * kPi));
  };
  const double one = std::asin(std::sin(limit.lower));
  const double other = std::asin(std::sin(limit.upper));
  return {holds(-0.5 * kPi) ? -0.5 * kPi : std::min(one, other),
          holds(0.5 * kPi) ? 0.5 * kPi : std::max(one, other)};
}

/// Of three turns Bullet tells the answer whose second one is within a quarter, so that limits have
/// to speak of that one: limits[2] is the first turn, limits[1] the second, limits[0] the third.
void speak_of_least_turns(std::array<Limit, 3>& limits) {
  constexpr double kQuarter = 0.5 * kPi + 1e-9;
  if (limits[1]) {
    if (limits[1]->is_within(kQuarter)) return;
    Interval other = limits[1]->mirrored().moved(kPi);
    other = other.moved(-2.0 * kPi * std::round(other.middle() / (2.0 * kPi)));
    if (other.is_within(kQuarter)) {
      limits[1] = other;
      for (const std::size_t outer : {0, 2}) {
        if (limits[outer]) {
          limits[outer] = limits[outer]->moved(limits[outer]->middle() > 0.0 ? -kPi : kPi);
        }
      }
      return;
    }
    limits[1] = folded(*limits[1]);
  }
  // Which of the two answers the others' limits mean changes on the way.
  limits[0].reset();
  limits[2].reset();
}

/// Turned so that the limit has 0 in the middle, since Bullet knows none across half a turn.
void centre(Limit& limit, btTransform& frame, int column, double sign) {
  const double angle = limit->middle();
  limit = limit->moved(-angle);
  btVector3 axis(0, 0, 0);
  axis[column] = 1.0;
  frame.setBasis(frame.getBasis() * btMatrix3x3(btQuaternion(axis, sign * angle)));
}

/// Bullet takes the frames apart as turns about z, y, then x, as CompoundJoint does, and counts
/// them the other way round.
std::unique_ptr<btTypedConstraint> make_compound(const Scene& scene, const CompoundJoint& compound,
                                                 const Mat3& world_from_joint, btRigidBody& parent,
                                                 btRigidBody& child, btTransform in_parent,
                                                 btTransform in_child) {
  const Interval locked{0.0, 0.0};
  std::array<Limit, 3> turns{locked, locked, locked};
  std::array<Limit, 3> slides{locked, locked, locked};
  int turn_count = 0;
  bool slides_beside_first_turn = false;
  for (const NodeId id : compound.joints) {
    const Joint& joint = *scene[id].joint;
    int column = 0;
    const Vec3 parts = compound.axes.transpose() * joint.axis;
    parts.cwiseAbs().maxCoeff(&column);
    if (joint.kind == JointKind::Revolute) {
      turns[std::size_t(column)] = turn_limit(joint, parts[column]);
      ++turn_count;
      continue;
    }
    slides_beside_first_turn = slides_beside_first_turn || column != 2;
    const double scale = (world_from_joint * joint.axis).norm();
    Interval limit{std::max(scale * joint.lower, -kFar), std::min(scale * joint.upper, kFar)};
    if (parts[column] < 0.0) limit = limit.mirrored();
    slides[std::size_t(column)] = limit;
    if (limit.upper - limit.lower >= 2.0 * kFar) slides[std::size_t(column)].reset();
  }
  if (turn_count == 3) speak_of_least_turns(turns);
  constexpr double kHalf = kPi - 1e-6;
  if (turns[0] && !turns[0]->is_within(kHalf)) centre(turns[0], in_child, 0, -1.0);
  if (turns[2] && !turns[2]->is_within(kHalf)) {
    if (turn_count == 1) {
      centre(turns[2], in_child, 2, -1.0);
    } else if (!slides_beside_first_turn) {
      centre(turns[2], in_parent, 2, 1.0);
    } else {
      turns[2].reset();  // slides are along the parent's axes
    }
  }
  auto made =
      std::make_unique<btGeneric6DofSpring2Constraint>(parent, child, in_parent, in_child, RO_XYZ);
  const auto limit = [&](int axis, const Limit& allowed) {
    const Interval all = allowed.value_or(Interval{1.0, -1.0});
    made->setLimit(axis, all.lower, all.upper);
    made->setParam(BT_CONSTRAINT_STOP_ERP, 0.8, axis);
  };
  for (int column = 0; column < 3; ++column) {
    limit(column, slides[std::size_t(column)]);
    const Limit& turn = turns[std::size_t(column)];
    limit(3 + column, turn ? Limit(turn->mirrored()) : turn);
  }
  return made;
}

/// A place between the joints of a chain; see Joint::child_body.
bool is_frame(const Scene& scene, NodeId id) {
  const Node& node = scene[id];
  return node.joint && node.joint->child_body == id && !node.rigid_body;
}

bool is_below(const Scene& scene, NodeId node, NodeId top) {
  for (; node; node = scene[node].parent) {
    if (node == top) return true;
  }
  return false;
}

void check_joint(const Scene& scene, NodeId id) {
  const Joint& joint = *scene[id].joint;
  const bool is_sound = joint.parent_from_joint.matrix().allFinite() &&
                        joint.child_from_joint.matrix().allFinite() &&
                        std::abs(joint.axis.norm() - 1.0) < 1e-6 && joint.lower <= joint.upper;
  if (is_sound) return;
  throw Error(ErrorKind::Asset, scene.path(id) +
                                    ": its joint needs finite places, an axis of unit length and "
                                    "a lower limit that is not above the upper one");
}

/// Where a joint is, and how fast, in radians or metres of its own.
struct Motion {
  double position = 0.0;
  double speed = 0.0;
};

Motion motion_of(HeldJoint& held) {
  btRigidBody& parent = held.constraint->getRigidBodyA();
  btRigidBody& child = held.constraint->getRigidBodyB();
  if (held.kind == JointKind::Prismatic) {
    // What the slider itself says of its position is that of the last step.
    auto& slider = static_cast<btSliderConstraint&>(*held.constraint);
    const btTransform rail = parent.getCenterOfMassTransform() * slider.getFrameOffsetA();
    const btVector3 axis = rail.getBasis().getColumn(0);
    const btVector3 place =
        (child.getCenterOfMassTransform() * slider.getFrameOffsetB()).getOrigin();
    const btVector3 speed =
        child.getVelocityInLocalPoint(place - child.getCenterOfMassPosition()) -
        parent.getVelocityInLocalPoint(place - parent.getCenterOfMassPosition());
    return {axis.dot(place - rail.getOrigin()) / held.scale, axis.dot(speed) / held.scale};
  }
  auto& hinge = static_cast<btHingeConstraint&>(*held.constraint);
  const btVector3 axis =
      (parent.getCenterOfMassTransform() * hinge.getAFrame()).getBasis().getColumn(2);
  return {hinge.getHingeAngle(),
          axis.dot(child.getAngularVelocity() - parent.getAngularVelocity())};
}

/// Where a motor says where a joint is, limits would fight it.
void take_limits_off(HeldJoint& held) {
  if (held.kind == JointKind::Prismatic) {
    auto& slider = static_cast<btSliderConstraint&>(*held.constraint);
    slider.setLowerLinLimit(-kFar);
    slider.setUpperLinLimit(kFar);
  } else {
    static_cast<btHingeConstraint&>(*held.constraint).setLimit(1.0, -1.0);
  }
}

/// Where the leader of a joint is, with the turns that it has made: as many as the follower's own
/// place tells.
double leader_position(const Scene& scene, const Joint& follower, double now) {
  constexpr int kMostTurns = 64;
  const Joint::Mimic& mimic = *follower.mimic;
  const Joint& leader = *scene[mimic.joint].joint;
  const double position = joint_position(scene, mimic.joint);
  if (leader.kind != JointKind::Revolute) return position;
  const bool turns = follower.kind == JointKind::Revolute;
  const auto plain = [&](double difference) {
    return std::abs(turns ? std::remainder(difference, 2.0 * kPi) : difference);
  };
  const auto off = [&](double at) { return plain(mimic.multiplier * at + mimic.offset - now); };
  double best = position;
  // What a turn changes less than that is as good without it.
  const double least_gain = std::max(0.25 * plain(mimic.multiplier * 2.0 * kPi), 1e-6);
  for (int turn = 1; turn <= kMostTurns; ++turn) {
    for (const int sign : {1, -1}) {
      const double at = position + 2.0 * kPi * sign * turn;
      // Followers themselves know no limits.
      if (!leader.mimic && (at < leader.lower || at > leader.upper)) continue;
      if (off(at) < off(best) - least_gain) best = at;
    }
  }
  return best;
}

/// Those that lead nowhere but to each other are left out, and move freely within their limits.
void add_followers(const Scene& scene, Bodies& bodies) {
  std::map<NodeId, std::size_t> held;
  std::vector<std::size_t> waiting;
  for (std::size_t i = 0; i < bodies.joints.size(); ++i) {
    const HeldJoint& joint = bodies.joints[i];
    if (joint.kind == JointKind::Fixed || joint.compound) continue;
    held.emplace(joint.node, i);
    if (scene[joint.node].joint->mimic) waiting.push_back(i);
  }
  // Leaders come first; those that only lead to each other never come.
  std::map<NodeId, std::vector<std::size_t>> by_leader;
  std::set<NodeId> followers;
  for (const std::size_t i : waiting) followers.insert(bodies.joints[i].node);
  std::deque<std::size_t> ready;
  for (const std::size_t i : waiting) {
    const NodeId leader = scene[bodies.joints[i].node].joint->mimic->joint;
    if (!scene.contains(leader) || !scene[leader].joint) continue;
    if (followers.contains(leader)) {
      by_leader[leader].push_back(i);
    } else {
      ready.push_back(i);
    }
  }
  for (; !ready.empty(); ready.pop_front()) {
    const std::size_t i = ready.front();
    const NodeId node = bodies.joints[i].node;
    const Joint::Mimic& mimic = *scene[node].joint->mimic;
    Follower follower{i, std::nullopt, mimic.multiplier, mimic.offset, 0.0};
    const auto leader = held.find(mimic.joint);
    if (leader != held.end()) follower.leader = leader->second;
    follower.leader_position =
        leader_position(scene, *scene[node].joint, joint_position(scene, node));
    bodies.followers.push_back(follower);
    take_limits_off(bodies.joints[i]);
    const auto led = by_leader.find(node);
    if (led != by_leader.end()) ready.insert(ready.end(), led->second.begin(), led->second.end());
  }
}

}  // namespace

void drive_followers(Bodies& bodies, double seconds) {
  constexpr double kStrong = 1e9;     // N or N s: whatever it takes
  constexpr double kStill = 1e-5;     // rad/s, m/s: sleeping bodies stay asleep
  constexpr double kCorrected = 0.5;  // of what is off, in one step ...
  constexpr double kFastest = 6.0;    // ... rad/s, m/s: what begins elsewhere strikes nothing
  for (Follower& follower : bodies.followers) {
    double speed = 0.0;
    if (follower.leader) {
      HeldJoint& leader = bodies.joints[*follower.leader];
      const Motion motion = motion_of(leader);
      const double moved = motion.position - follower.leader_position;
      follower.leader_position +=
          leader.kind == JointKind::Revolute ? std::remainder(moved, 2.0 * kPi) : moved;
      speed = follower.multiplier * motion.speed;
    }
    HeldJoint& held = bodies.joints[follower.joint];
    const double wanted = follower.multiplier * follower.leader_position + follower.offset;
    double off = wanted - motion_of(held).position;
    if (held.kind == JointKind::Revolute) off = std::remainder(off, 2.0 * kPi);
    speed += std::clamp(kCorrected * off / seconds, -kFastest, kFastest);
    if (std::abs(speed) > kStill) {
      held.constraint->getRigidBodyA().activate();
      held.constraint->getRigidBodyB().activate();
    }
    if (held.kind == JointKind::Prismatic) {
      auto& slider = static_cast<btSliderConstraint&>(*held.constraint);
      slider.setPoweredLinMotor(true);
      slider.setMaxLinMotorForce(kStrong);
      slider.setTargetLinMotorVelocity(speed * held.scale);
    } else {
      static_cast<btHingeConstraint&>(*held.constraint).enableAngularMotor(true, speed, kStrong);
    }
  }
}

void add_joints(const Scene& scene, Bodies& bodies) {
  MovingBodies moving;
  for (std::size_t i = 0; i < bodies.moving.size(); ++i) moving[bodies.moving[i].node] = i;
  if (moving.empty()) return;
  std::map<NodeId, CompoundJoint> compounds;  // by their last joint
  std::set<NodeId> in_compound;
  for (CompoundJoint& compound : compound_joints(scene)) {
    in_compound.insert(compound.joints.begin(), compound.joints.end());
    const NodeId last = compound.joints.back();
    compounds.emplace(last, std::move(compound));
  }
  for (const NodeId id : joints_of(scene)) {
    const auto compound = compounds.find(id);
    const bool is_compound = compound != compounds.end();
    if (!is_compound && in_compound.contains(id)) continue;
    const Joint& last = *scene[id].joint;
    const Joint& first = is_compound ? *scene[compound->second.joints.front()].joint : last;
    // Frames of no compound belong to nothing that moves, and would pin bodies to the world.
    if (is_frame(scene, last.child_body)) continue;
    if (is_frame(scene, first.parent_body)) {
      if (body_above(scene, last.child_body, moving, bodies)) {
        bodies.unheld.push_back(scene.path(id));
      }
      continue;
    }
    const MovingBody* parent = body_above(scene, first.parent_body, moving, bodies);
    const MovingBody* child = body_above(scene, last.child_body, moving, bodies);
    if (parent == child) continue;
    check_joint(scene, id);
    if (is_compound) {
      for (const NodeId part : compound->second.joints) check_joint(scene, part);
    }
    if (!bodies.anchor) {
      bodies.anchor = std::make_unique<btRigidBody>(
          btRigidBody::btRigidBodyConstructionInfo(0.0, nullptr, nullptr));
    }
    const Affine world_from_parent_joint =
        scene.world_from_node(first.parent_body) * first.parent_from_joint;
    const Affine world_from_child_joint =
        scene.world_from_node(last.child_body) * last.child_from_joint;
    const auto turned = [&](const Affine& world_from_joint) {
      return is_compound ? turned_to_axes(world_from_joint, compound->second.axes)
                         : turned_to_axis(world_from_joint, last);
    };
    const btTransform in_parent = frame_in(parent, turned(world_from_parent_joint));
    const btTransform in_child = frame_in(child, turned(world_from_child_joint));
    btRigidBody& parent_body = parent ? *parent->body : *bodies.anchor;
    btRigidBody& child_body = child ? *child->body : *bodies.anchor;
    HeldJoint held;
    held.path = scene.path(id);
    held.node = id;
    held.kind = last.kind;
    held.scale = (world_from_parent_joint.linear() * last.axis).norm();
    if (is_compound) {
      held.compound = compound->second;
      held.constraint = make_compound(scene, compound->second, world_from_parent_joint.linear(),
                                      parent_body, child_body, in_parent, in_child);
    } else if (last.kind == JointKind::Revolute) {
      held.constraint = make_hinge(last, parent_body, child_body, in_parent, in_child);
    } else if (last.kind == JointKind::Prismatic) {
      held.constraint = make_slider(last, held.scale, parent_body, child_body, in_parent, in_child);
    } else {
      held.constraint =
          std::make_unique<btFixedConstraint>(parent_body, child_body, in_parent, in_child);
    }
    bodies.joints.push_back(std::move(held));
    if (parent && child) continue;
    const NodeId still = parent ? last.child_body : first.parent_body;
    btRigidBody& body = parent ? parent_body : child_body;
    for (const StaticObject& fixed : bodies.statics) {
      if (is_below(scene, fixed.node, still))
        body.setIgnoreCollisionCheck(fixed.object.get(), true);
    }
  }
  add_followers(scene, bodies);
}

}  // namespace diorama
