// SPDX-License-Identifier: Apache-2.0
#include "diorama/joints.h"

#include <cmath>
#include <vector>

#include "support/catch.h"

namespace diorama {
namespace {

Affine pose(const Vec3& place, double angle, const Vec3& axis, double scale = 1.0) {
  Affine affine = Affine(Eigen::Translation3d(place));
  affine.linear() = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix() * scale;
  return affine;
}

/// A joint whose space is `world_from_joint` for both bodies as they stand now.
NodeId add_joint(Scene& scene, std::string_view name, JointKind kind, NodeId parent, NodeId child,
                 const Affine& world_from_joint, const Vec3& axis) {
  const NodeId id = scene.create(scene.root(), name);
  Joint joint;
  joint.kind = kind;
  joint.parent_body = parent;
  joint.child_body = child;
  joint.parent_from_joint = scene.world_from_node(parent).inverse() * world_from_joint;
  joint.child_from_joint = scene.world_from_node(child).inverse() * world_from_joint;
  joint.axis = axis;
  scene.edit(id).joint = joint;
  return id;
}

/// A shoulder that turns about z at (1, 2, 3), an elbow that turns about z one metre along x.
struct Arm {
  Scene scene;
  NodeId base = scene.create(scene.root(), "base");
  NodeId upper = scene.create(scene.root(), "upper");
  NodeId fore;
  NodeId shoulder, elbow;

  explicit Arm(bool is_nested) {
    scene.set_pose(base, pose({0.3, -0.2, 0.1}, 0.7, {1, 2, 3}, 1.5));
    scene.set_pose(upper, pose({1.4, 2.0, 3.0}, 0.0, {0, 0, 1}));
    fore = scene.create(is_nested ? upper : scene.root(), "fore");
    const Affine world_from_fore = pose({2.5, 2.0, 3.0}, 0.0, {0, 0, 1});
    scene.set_pose(fore, is_nested ? scene.world_from_node(upper).inverse() * world_from_fore
                                   : world_from_fore);
    shoulder = add_joint(scene, "shoulder", JointKind::Revolute, base, upper,
                         pose({1, 2, 3}, 0.0, {0, 0, 1}), Vec3::UnitZ());
    elbow = add_joint(scene, "elbow", JointKind::Revolute, upper, fore,
                      pose({2, 2, 3}, 0.0, {0, 0, 1}), Vec3::UnitZ());
  }
  Vec3 place_of(NodeId node) const { return scene.world_from_node(node).translation(); }
};

}  // namespace

TEST_CASE("an arm bent at shoulder and elbow is where trigonometry says", "[joints]") {
  for (const bool is_nested : {false, true}) {
    Arm arm(is_nested);
    const Affine base_before = arm.scene.world_from_node(arm.base);
    pose_joints(arm.scene, std::vector<JointTarget>{{arm.shoulder, 0.5 * kPi}, {arm.elbow, -0.3}});
    CHECK((arm.place_of(arm.upper) - Vec3(1.0, 2.4, 3.0)).norm() < 1e-12);
    const double angle = 0.5 * kPi - 0.3;
    const Vec3 fore(1.0 + 0.5 * std::cos(angle), 3.0 + 0.5 * std::sin(angle), 3.0);
    CHECK((arm.place_of(arm.fore) - fore).norm() < 1e-12);
    CHECK(joint_position(arm.scene, arm.shoulder) == Approx(0.5 * kPi).epsilon(1e-12));
    CHECK(joint_position(arm.scene, arm.elbow) == Approx(-0.3).epsilon(1e-12));
    CHECK(arm.scene.world_from_node(arm.base).matrix() == base_before.matrix());
  }
}

TEST_CASE("what hangs on a posed body follows it as it was", "[joints]") {
  for (const bool is_nested : {false, true}) {
    Arm arm(is_nested);
    pose_joints(arm.scene, std::vector<JointTarget>{{arm.elbow, 0.4}});
    pose_joints(arm.scene, std::vector<JointTarget>{{arm.shoulder, -1.0}});
    CHECK(joint_position(arm.scene, arm.elbow) == Approx(0.4).epsilon(1e-12));
    CHECK(joint_position(arm.scene, arm.shoulder) == Approx(-1.0).epsilon(1e-12));
  }
}

TEST_CASE("a drawer in a cabinet that was scaled slides so much further", "[joints]") {
  Scene scene;
  const NodeId top = scene.create(scene.root(), "top");
  const NodeId cabinet = scene.create(top, "cabinet");
  const NodeId drawer = scene.create(top, "drawer");
  scene.set_pose(cabinet, pose({0.1, 0.2, 0.3}, 0.0, {0, 0, 1}, 0.01));
  const NodeId slide = add_joint(scene, "slide", JointKind::Prismatic, cabinet, drawer,
                                 pose({0.0, 0.0, 0.5}, 0.9, {0, 1, 0}), Vec3::UnitX());
  scene.set_pose(top, pose({5, 6, 7}, 1.1, {1, 0, 1}, 2.0));
  const Vec3 before = scene.world_from_node(drawer).translation();
  pose_joints(scene, std::vector<JointTarget>{{slide, 0.25}});
  CHECK((scene.world_from_node(drawer).translation() - before).norm() ==
        Approx(0.5).epsilon(1e-12));
  CHECK(joint_position(scene, slide) == Approx(0.25).epsilon(1e-12));
}

TEST_CASE("a joint that mimics another one follows it, and circles of them end", "[joints]") {
  Arm arm(false);
  arm.scene.edit(arm.elbow).joint->mimic = Joint::Mimic{arm.shoulder, -2.0, 0.1};
  arm.scene.edit(arm.shoulder).joint->mimic = Joint::Mimic{arm.elbow, 1.0, 0.0};
  pose_joints(arm.scene, std::vector<JointTarget>{{arm.shoulder, 0.2}});
  CHECK(joint_position(arm.scene, arm.shoulder) == Approx(0.2).epsilon(1e-12));
  CHECK(joint_position(arm.scene, arm.elbow) == Approx(-0.3).epsilon(1e-12));
}

TEST_CASE("angles are told as the limits allow them", "[joints]") {
  Arm arm(false);
  Joint& joint = *arm.scene.edit(arm.shoulder).joint;
  joint.lower = 0.5 * kPi;
  joint.upper = 2.5 * kPi;
  pose_joints(arm.scene, std::vector<JointTarget>{{arm.shoulder, 1.75 * kPi}});
  CHECK(joint_position(arm.scene, arm.shoulder) == Approx(1.75 * kPi));
  arm.scene.edit(arm.shoulder).joint->lower = -kInfinity;
  arm.scene.edit(arm.shoulder).joint->upper = kInfinity;
  CHECK(joint_position(arm.scene, arm.shoulder) == Approx(-0.25 * kPi));
}

TEST_CASE("loops of joints, missing bodies and numbers that are none leave things whole",
          "[joints]") {
  Arm arm(false);
  const NodeId loop = add_joint(arm.scene, "loop", JointKind::Revolute, arm.fore, arm.upper,
                                pose({2, 2, 3}, 0.0, {0, 0, 1}), Vec3::UnitZ());
  const NodeId self = add_joint(arm.scene, "self", JointKind::Fixed, arm.fore, arm.fore,
                                pose({2, 2, 3}, 0.0, {0, 0, 1}), Vec3::UnitZ());
  const NodeId lost = arm.scene.create(arm.scene.root(), "lost");
  arm.scene.edit(lost).joint = Joint{};
  pose_joints(arm.scene, std::vector<JointTarget>{{loop, 1.0}, {self, 1.0}, {lost, 1.0}});
  CHECK((arm.place_of(arm.fore) - Vec3(2.5, 2.0, 3.0)).norm() < 1e-12);
  pose_joints(arm.scene, std::vector<JointTarget>{{arm.shoulder, kInfinity}});
  CHECK((arm.place_of(arm.upper) - Vec3(1.4, 2.0, 3.0)).norm() < 1e-12);
  const auto states = joint_states(arm.scene);
  REQUIRE(states.size() == 4);
  CHECK(states[1].path == "/elbow");
  CHECK(states[1].parent_path == "/upper");
  CHECK(states[1].child_path == "/fore");
  arm.scene.erase(arm.fore);
  CHECK(joints_of(arm.scene).size() == 1);
}

TEST_CASE("a joint of several axes is a chain whose frames share the motion", "[joints]") {
  // In a parent that is turned and twice the size, with a node above the frames that is neither.
  for (const bool is_left_handed : {false, true}) {
    Scene scene;
    const NodeId parent = scene.create(scene.root(), "parent");
    const NodeId child = scene.create(scene.root(), "child");
    scene.set_pose(parent, pose({0.3, -0.2, 0.1}, 0.7, {1, 2, 3}, 2.0));
    const Affine world_from_joint =
        scene.world_from_node(parent) * pose({0.1, 0.2, 0.3}, -0.4, {0, 1, 1});
    scene.set_pose(child, world_from_joint * pose({0.5, 0, 0}, 0.3, {0, 0, 1}));
    const NodeId hip = scene.create(scene.root(), "hip");
    scene.set_pose(hip, pose({5, 5, 5}, 1.0, {1, 0, 0}));
    const double sign = is_left_handed ? -1.0 : 1.0;
    const std::vector<std::pair<JointKind, Vec3>> axes{{JointKind::Prismatic, Vec3::UnitY()},
                                                       {JointKind::Prismatic, -Vec3::UnitX()},
                                                       {JointKind::Revolute, Vec3::UnitZ()},
                                                       {JointKind::Revolute, -Vec3::UnitX()},
                                                       {JointKind::Revolute, sign * Vec3::UnitY()}};
    std::vector<NodeId> joints;
    for (const auto& [kind, axis] : axes) {
      const NodeId id = scene.create(hip, "axis");
      scene.set_pose(id, scene.world_from_node(hip).inverse() * world_from_joint);
      Joint joint;
      joint.kind = kind;
      joint.axis = axis;
      joint.parent_body = joints.empty() ? parent : joints.back();
      joint.child_body = joints.size() + 1 < axes.size() ? id : child;
      if (joints.empty()) {
        joint.parent_from_joint = scene.world_from_node(parent).inverse() * world_from_joint;
      }
      if (joint.child_body == child) {
        joint.child_from_joint = scene.world_from_node(child).inverse() * world_from_joint;
      }
      scene.edit(id).joint = joint;
      joints.push_back(id);
    }
    // The middle turn goes beyond a quarter, which its limits say.
    scene.edit(joints[3]).joint->lower = 1.8;
    scene.edit(joints[3]).joint->upper = 2.5;
    const auto compounds = compound_joints(scene);
    REQUIRE(compounds.size() == 1);
    CHECK(compounds.front().joints == joints);
    const std::vector<double> wanted{0.2, -0.1, 0.6, 2.1, -0.8};
    std::vector<JointTarget> targets;
    for (std::size_t i = 0; i < joints.size(); ++i) targets.push_back({joints[i], wanted[i]});
    pose_joints(scene, targets);
    // A body that was carried there by something else: frames follow.
    for (std::size_t i = 0; i + 1 < joints.size(); ++i) {
      scene.set_pose(joints[i], pose({1, 2, 3}, 0.3, {1, 1, 0}));
    }
    place_frames(scene, compounds.front());
    for (std::size_t i = 0; i < joints.size(); ++i) {
      CAPTURE(i, is_left_handed);
      CHECK(joint_position(scene, joints[i]) == Approx(wanted[i]).margin(1e-9));
    }
    // Its size is that of the parent.
    CHECK(
        (scene.world_from_node(joints[1]).translation() - world_from_joint.translation()).norm() ==
        Approx(2.0 * std::hypot(0.2, 0.1)));
  }
}

TEST_CASE("frames tell the answer that lies nearest to where they stood", "[joints]") {
  Scene scene;
  const NodeId child = scene.create(scene.root(), "child");
  std::vector<NodeId> joints;
  for (int i = 0; i < 3; ++i) {
    const NodeId id = scene.create(scene.root(), "turn");
    Joint joint;
    joint.kind = JointKind::Revolute;
    joint.axis = Vec3::Unit(i);
    joint.parent_body = i == 0 ? scene.root() : joints.back();
    joint.child_body = i == 2 ? child : id;
    scene.edit(id).joint = joint;
    joints.push_back(id);
  }
  const auto compounds = compound_joints(scene);
  REQUIRE(compounds.size() == 1);
  const auto check = [&](double a, double b, double c) {
    for (const auto& [id, wanted] :
         {std::pair(joints[0], a), std::pair(joints[1], b), std::pair(joints[2], c)}) {
      CHECK(joint_position(scene, id) == Approx(wanted).margin(1e-9));
    }
  };
  pose_joints(scene, std::vector<JointTarget>{{joints[0], 0.3}, {joints[1], 2.0}, {joints[2], 1}});
  place_frames(scene, compounds.front());
  check(0.3, 2.0, 1.0);
  // Across the quarter turn, a step at a time, where only the body moves.
  for (double b = 1.99; b > 1.0; b -= 0.03) {
    scene.set_pose(
        child, Affine(Eigen::AngleAxisd(0.3, Vec3::UnitX()) * Eigen::AngleAxisd(b, Vec3::UnitY()) *
                      Eigen::AngleAxisd(1.0, Vec3::UnitZ())));
    place_frames(scene, compounds.front());
    CAPTURE(b);
    check(0.3, b, 1.0);
  }
  // One that leads another is no part of a chain.
  const NodeId follower = scene.create(scene.root(), "follower");
  Joint follows = *scene[joints[2]].joint;
  follows.parent_body = scene.root();
  follows.child_body = scene.create(scene.root(), "led");
  follows.mimic = Joint::Mimic{joints[1], 1.0, 0.0};
  scene.edit(follower).joint = follows;
  CHECK(compound_joints(scene).empty());
}

TEST_CASE("chains that bend at no right angle or end nowhere are no joint of several axes",
          "[joints]") {
  Scene scene;
  const NodeId child = scene.create(scene.root(), "child");
  const NodeId first = scene.create(scene.root(), "first");
  const NodeId second = scene.create(scene.root(), "second");
  Joint joint;
  joint.kind = JointKind::Revolute;
  joint.parent_body = scene.root();
  joint.child_body = first;
  scene.edit(first).joint = joint;
  joint.parent_body = first;
  joint.child_body = child;
  joint.axis = Vec3(1, 1, 0).normalized();
  scene.edit(second).joint = joint;
  CHECK(compound_joints(scene).empty());
  scene.edit(second).joint->axis = Vec3::UnitY();
  CHECK(compound_joints(scene).size() == 1);
  scene.edit(second).joint->parent_from_joint = pose({0, 0, 0.1}, 0.0, {0, 0, 1});
  CHECK(compound_joints(scene).empty());
  scene.edit(second).joint->parent_from_joint = Affine::Identity();
  // Frames that lead to each other.
  scene.edit(first).joint->parent_body = second;
  scene.edit(second).joint->child_body = second;
  CHECK(compound_joints(scene).empty());
}

}  // namespace diorama
