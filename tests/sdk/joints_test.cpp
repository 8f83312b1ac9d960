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

}  // namespace diorama
