// SPDX-License-Identifier: Apache-2.0
#include "diorama/joints.h"

#include <cmath>
#include <string>
#include <vector>

#include "plugins/physics_bullet/physics_world.h"
#include "support/catch.h"

namespace diorama {

using test::at;
using test::PhysicsWorld;

namespace {

/// Joint space is the same for both bodies as they stand, at `place`.
NodeId join(PhysicsWorld& world, JointKind kind, NodeId parent, NodeId child,
            const Affine& world_from_joint, const Vec3& axis, double lower = -kInfinity,
            double upper = kInfinity) {
  const NodeId id = world.scene.create(world.scene.root(), "joint");
  Joint joint;
  joint.kind = kind;
  joint.parent_body = parent;
  joint.child_body = child;
  joint.parent_from_joint = world.scene.world_from_node(parent).inverse() * world_from_joint;
  joint.child_from_joint = world.scene.world_from_node(child).inverse() * world_from_joint;
  joint.axis = axis;
  joint.lower = lower;
  joint.upper = upper;
  world.scene.edit(id).joint = joint;
  return id;
}

Affine tilted(double x, double y, double z, double angle, const Vec3& axis) {
  Affine pose = at(x, y, z);
  pose.linear() = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  return pose;
}

BulletBackend::Params undamped() {
  BulletBackend::Params params;
  params.angular_damping = 0.0;
  params.sub_steps = 8;
  return params;
}

}  // namespace

TEST_CASE("a drawer slides to the end of its limits and stays there", "[physics_bullet]") {
  PhysicsWorld world;
  // The cabinet leans forward by 40 degrees, so that the drawer slides out along its own -y.
  const double lean = 40.0 * kPi / 180.0;
  const NodeId cabinet = world.add_primitive("cabinet", PrimitiveShape::Box, Vec3(0.5, 0.4, 0.3),
                                             tilted(1, 2, 3, lean, Vec3::UnitX()));
  const NodeId drawer = world.add_primitive("drawer", PrimitiveShape::Box, Vec3(0.4, 0.38, 0.2),
                                            tilted(1, 2, 3, lean, Vec3::UnitX()));
  world.make_body(drawer, 2.5);
  const NodeId slide = join(world, JointKind::Prismatic, cabinet, drawer,
                            tilted(1, 2, 3, lean, Vec3::UnitX()), Vec3::UnitY(), -0.3, 0.0);
  world.run(120);
  // It lies within the cabinet, with which it does not collide.
  CHECK(joint_position(world.scene, slide) == Approx(-0.3).margin(0.002));
  const Affine cabinet_from_drawer =
      world.scene.world_from_node(cabinet).inverse() * world.scene.world_from_node(drawer);
  CHECK(std::abs(cabinet_from_drawer.translation().x()) < 0.002);
  CHECK(std::abs(cabinet_from_drawer.translation().z()) < 0.002);
  CHECK(world.backend.report().max_speed < 0.01);
  // Posed half open in a cabinet that leans back, it shuts.
  world.scene.set_pose(cabinet, tilted(1, 2, 3, -lean, Vec3::UnitX()));
  pose_joints(world.scene, std::vector<JointTarget>{{slide, -0.15}});
  world.run(120);
  CHECK(joint_position(world.scene, slide) == Approx(0.0).margin(0.002));
}

TEST_CASE("a pendulum swings with the period that its length gives", "[physics_bullet]") {
  PhysicsWorld world(undamped());
  const NodeId hook = world.scene.create(world.scene.root(), "hook");
  world.scene.set_pose(hook, at(0.3, -0.2, 2.0));
  const double length = 0.5;
  const double radius = 0.02;
  const NodeId bob = world.add_primitive("bob", PrimitiveShape::Sphere,
                                         Vec3::Constant(2.0 * radius), at(0.3, -0.2, 1.5));
  world.make_body(bob, 0.7);
  const NodeId hinge =
      join(world, JointKind::Revolute, hook, bob, at(0.3, -0.2, 2.0), Vec3::UnitY());
  pose_joints(world.scene, std::vector<JointTarget>{{hinge, 0.1}});
  world.backend.reset(world.scene);
  // Time from one upward passage to the second next one.
  std::vector<double> passages;
  double before = joint_position(world.scene, hinge);
  CHECK(before == Approx(0.1));
  for (int step = 1; step <= 360 && passages.size() < 3; ++step) {
    world.backend.advance(world.scene, 1);
    const double now = joint_position(world.scene, hinge);
    if (before < 0.0 && now >= 0.0) {
      passages.push_back((step - now / (now - before)) * world.backend.step_seconds());
    }
    before = now;
  }
  REQUIRE(passages.size() == 3);
  const double period = (passages[2] - passages[0]) / 2.0;
  // Of a small swing of 0.1 rad, with the inertia of the ball itself.
  const double arm = std::sqrt(length * length + 0.4 * radius * radius);
  const double expected = 2.0 * kPi * arm * std::sqrt(1.0 / (9.81 * length)) * (1 + 0.01 / 16);
  CHECK(period == Approx(expected).epsilon(0.01));
}

TEST_CASE("a door turns within its limits and not beyond", "[physics_bullet]") {
  PhysicsWorld world;
  // A hatch in a wall, hinged at its upper edge, held up: it falls shut and stops at 20 degrees.
  const NodeId wall =
      world.add_primitive("wall", PrimitiveShape::Box, Vec3(0.1, 2, 2), at(0, 0, 1));
  const NodeId hatch =
      world.add_primitive("hatch", PrimitiveShape::Box, Vec3(0.02, 0.5, 0.5), at(0.2, 0, 1.25));
  world.make_body(hatch, 3.0);
  const double limit = 20.0 * kPi / 180.0;
  const NodeId hinge =
      join(world, JointKind::Revolute, wall, hatch, at(0.2, 0, 1.5), -Vec3::UnitY(), limit, 2.0);
  pose_joints(world.scene, std::vector<JointTarget>{{hinge, 1.5}});
  CHECK(world.position(hatch).x() > 0.4);
  world.run(240);
  CHECK(joint_position(world.scene, hinge) == Approx(limit).margin(0.02));
}

TEST_CASE("what a fixed joint holds falls as one and stays together", "[physics_bullet]") {
  PhysicsWorld world;
  world.add_floor();
  const NodeId one =
      world.add_primitive("one", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(0, 0, 0.6));
  const NodeId two =
      world.add_primitive("two", PrimitiveShape::Box, Vec3(0.3, 0.1, 0.1), at(0.2, 0, 0.75));
  world.make_body(one, 1.0);
  world.make_body(two, 0.5);
  join(world, JointKind::Fixed, one, two, at(0.1, 0, 0.7), Vec3::UnitX());
  const Affine before =
      world.scene.world_from_node(one).inverse() * world.scene.world_from_node(two);
  world.run(180);
  const Affine after =
      world.scene.world_from_node(one).inverse() * world.scene.world_from_node(two);
  CHECK((before.translation() - after.translation()).norm() < 0.005);
  CHECK(Quat(Mat3(before.linear().transpose() * after.linear())).angularDistance(Quat::Identity()) <
        0.02);
  CHECK(world.position(one).z() < 0.2);
}

TEST_CASE("bodies in a circle of joints, and joints that hold nothing that moves, do no harm",
          "[physics_bullet]") {
  PhysicsWorld world;
  const NodeId a = world.add_primitive("a", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(0, 0, 1));
  const NodeId b = world.add_primitive("b", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(1, 0, 1));
  const NodeId c = world.add_primitive("c", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(5, 5, 1));
  const NodeId d = world.add_primitive("d", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(6, 5, 1));
  world.make_body(a);
  world.make_body(b);
  join(world, JointKind::Revolute, a, b, at(0.5, 0, 1), Vec3::UnitX());
  join(world, JointKind::Revolute, b, a, at(0.5, 0, 1), Vec3::UnitX());
  join(world, JointKind::Fixed, c, d, at(5.5, 5, 1), Vec3::UnitX());
  join(world, JointKind::Fixed, a, a, at(0, 0, 1), Vec3::UnitX());
  world.run(30);
  CHECK((world.position(b) - world.position(a)).norm() == Approx(1.0).margin(0.01));
  CHECK(world.position(d) == Vec3(6, 5, 1));
}

TEST_CASE("joints that mimic others follow them while things fall", "[physics_bullet]") {
  PhysicsWorld world;
  const NodeId rail = world.scene.create(world.scene.root(), "rail");
  // A weight that slides down; a counterpart that it pulls up twice as fast, in units of half the
  // size; a pointer that turns with it, and one that turns with the pointer.
  const NodeId weight =
      world.add_primitive("weight", PrimitiveShape::Box, Vec3(0.1, 0.1, 0.1), at(0, 0, 2));
  const NodeId half = world.scene.create(world.scene.root(), "half");
  world.scene.set_pose(half, Affine(at(1, 0, 2) * Eigen::Scaling(0.5)));
  const NodeId other =
      world.add_primitive("other", PrimitiveShape::Box, Vec3(0.1, 0.1, 0.1), at(1, 0, 2));
  const NodeId pointer =
      world.add_primitive("pointer", PrimitiveShape::Box, Vec3(0.3, 0.02, 0.02), at(2.15, 0, 2));
  const NodeId second =
      world.add_primitive("second", PrimitiveShape::Box, Vec3(0.3, 0.02, 0.02), at(3.15, 0, 2));
  for (const NodeId body : {weight, other, pointer, second}) world.make_body(body, 0.5);
  const NodeId slide =
      join(world, JointKind::Prismatic, rail, weight, at(0, 0, 2), -Vec3::UnitZ(), 0.0, 0.8);
  Affine in_half = at(1, 0, 2);
  in_half.linear() *= 0.5;
  const NodeId lift = join(world, JointKind::Prismatic, half, other, in_half, Vec3::UnitZ());
  const NodeId turn =
      join(world, JointKind::Revolute, rail, pointer, at(2, 0, 2), Vec3::UnitY(), -0.1, 0.1);
  const NodeId turn_on = join(world, JointKind::Revolute, rail, second, at(3, 0, 2), Vec3::UnitX());
  world.scene.edit(lift).joint->mimic = Joint::Mimic{slide, 2.0, 0.1};
  // By more than a whole turn, and beyond limits, which hold for what is not led.
  world.scene.edit(turn).joint->mimic = Joint::Mimic{slide, 9.0, -0.2};
  world.scene.edit(turn_on).joint->mimic = Joint::Mimic{turn, -0.5, 0.0};
  pose_joints(world.scene, std::vector<JointTarget>{{slide, 0.0}});
  world.backend.reset(world.scene);
  double fallen = 0.0;
  int steps_behind = 0;
  for (int step = 0; step < 60; ++step) {
    world.backend.advance(world.scene, 1);
    const double now = joint_position(world.scene, slide);
    CAPTURE(step, now);
    // What stops at once is a step of the engine ahead of what follows it.
    const bool stopped = fallen < 0.79 && now >= 0.79;
    steps_behind = stopped ? 4 : steps_behind - 1;
    fallen = now;
    if (steps_behind > 0) continue;
    CHECK(joint_position(world.scene, lift) == Approx(2.0 * now + 0.1).margin(0.01));
    const double angle = joint_position(world.scene, turn) - (9.0 * now - 0.2);
    CHECK(std::remainder(angle, 2.0 * kPi) == Approx(0.0).margin(0.05));
    const double angle_on = joint_position(world.scene, turn_on) + 0.5 * (9.0 * now - 0.2);
    CHECK(std::remainder(angle_on, 2.0 * kPi) == Approx(0.0).margin(0.05));
  }
  // It falls freely until its limit: nothing that follows holds it back.
  CHECK(fallen == Approx(0.8).margin(0.01));
  // At the end all stand still.
  world.backend.advance(world.scene, 60);
  CHECK(joint_position(world.scene, lift) == Approx(1.7).margin(0.005));
  CHECK(world.backend.report().max_speed < 0.02);
}

TEST_CASE("a joint that follows nothing keeps its limits", "[physics_bullet]") {
  PhysicsWorld world;
  const NodeId rail = world.scene.create(world.scene.root(), "rail");
  const NodeId weight =
      world.add_primitive("weight", PrimitiveShape::Box, Vec3(0.1, 0.1, 0.1), at(0, 0, 2));
  world.make_body(weight, 0.5);
  const NodeId slide =
      join(world, JointKind::Prismatic, rail, weight, at(0, 0, 2), -Vec3::UnitZ(), 0.0, 0.4);
  world.scene.edit(slide).joint->mimic = Joint::Mimic{slide, 1.0, 0.0};
  world.run(90);
  CHECK(joint_position(world.scene, slide) == Approx(0.4).margin(0.01));
}

TEST_CASE("what is held to the world meets what stands there", "[physics_bullet]") {
  // A weight on a rail, above a plate of the same asset. The rail has no part in what lies beside
  // it; a rail that the plate is part of lets its slide through.
  for (const bool is_part : {false, true}) {
    PhysicsWorld world;
    const NodeId asset = world.scene.create(world.scene.root(), "asset");
    const NodeId rail = is_part ? asset : world.scene.create(asset, "world");
    const NodeId plate = world.scene.create(asset, "plate");
    world.scene.edit(plate).collider =
        Collider{ColliderShape::Primitive, PrimitiveShape::Box, Vec3(1.0, 1.0, 0.1)};
    const NodeId weight =
        world.add_primitive("weight", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(0, 0, 1));
    world.make_body(weight);
    join(world, JointKind::Prismatic, rail, weight, at(0, 0, 1), Vec3::UnitZ());
    world.run(90);
    CHECK((world.position(weight).z() > 0.14) == !is_part);
  }
}

TEST_CASE("a body that nothing can touch moves with what joints hold it to", "[physics_bullet]") {
  PhysicsWorld world;
  world.add_floor();
  const NodeId box =
      world.add_primitive("box", PrimitiveShape::Box, Vec3(0.5, 0.5, 0.2), at(0, 0, 1));
  const NodeId cross = world.scene.create(world.scene.root(), "cross");
  world.scene.set_pose(cross, at(0.3, 0, 1));
  const NodeId arm =
      world.add_primitive("arm", PrimitiveShape::Box, Vec3(0.3, 0.1, 0.1), at(0.5, 0, 1));
  for (const NodeId body : {box, cross, arm}) world.make_body(body, body == cross ? 0.1 : 1.0);
  join(world, JointKind::Revolute, box, cross, at(0.3, 0, 1), Vec3::UnitY());
  join(world, JointKind::Revolute, cross, arm, at(0.3, 0, 1), Vec3::UnitX());
  world.run(240);
  CHECK(world.position(box).z() == Approx(0.1).margin(0.01));
  CHECK(world.position(arm).z() < 0.2);
  CHECK(world.position(arm).z() > 0.03);
  CHECK((world.position(cross) - world.position(box)).norm() == Approx(0.3).margin(0.02));
}

TEST_CASE("a joint with numbers that cannot be is named", "[physics_bullet]") {
  PhysicsWorld world;
  const NodeId a = world.add_primitive("a", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(0, 0, 1));
  const NodeId b = world.add_primitive("b", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(1, 0, 1));
  world.make_body(b);
  join(world, JointKind::Revolute, a, b, at(0.5, 0, 1), Vec3::UnitX(), 2.0, 1.0);
  CHECK_THROWS_WITH(world.run(1), ContainsSubstring("/joint: its joint needs finite places"));
}

}  // namespace diorama
