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

TEST_CASE("what follows turns beyond one goes on when physics is set up anew", "[physics_bullet]") {
  PhysicsWorld world;
  const NodeId rail = world.scene.create(world.scene.root(), "rail");
  const NodeId wheel =
      world.add_primitive("wheel", PrimitiveShape::Box, Vec3(0.3, 0.3, 0.02), at(0, 0, 2));
  const NodeId hand =
      world.add_primitive("hand", PrimitiveShape::Box, Vec3(0.3, 0.02, 0.02), at(1, 0, 2));
  const NodeId rack =
      world.add_primitive("rack", PrimitiveShape::Box, Vec3(0.3, 0.02, 0.02), at(2, 0, 2));
  for (const NodeId body : {wheel, hand, rack}) world.make_body(body, 0.5);
  const NodeId turn = join(world, JointKind::Revolute, rail, wheel, at(0, 0, 2), Vec3::UnitZ());
  const NodeId slow = join(world, JointKind::Revolute, rail, hand, at(1, 0, 2), Vec3::UnitZ());
  const NodeId slide = join(world, JointKind::Prismatic, rail, rack, at(2, 0, 2), Vec3::UnitX());
  world.scene.edit(slow).joint->mimic = Joint::Mimic{turn, 0.25, 0.0};
  world.scene.edit(slide).joint->mimic = Joint::Mimic{turn, 0.05, 0.1};
  pose_joints(world.scene, std::vector<JointTarget>{{turn, 0.0}});
  world.scene.set_velocity(wheel, Vec3::Zero(), Vec3(0, 0, 12.0));
  double turned = 0.0;
  double before = 0.0;
  for (int step = 0; step < 120; ++step) {
    if (step % 15 == 0) world.backend.reset(world.scene);
    world.backend.advance(world.scene, 1);
    const double now = joint_position(world.scene, turn);
    turned += std::remainder(now - before, 2.0 * kPi);
    before = now;
    CAPTURE(step, turned);
    const double angle = joint_position(world.scene, slow) - 0.25 * turned;
    CHECK(std::remainder(angle, 2.0 * kPi) == Approx(0.0).margin(0.05));
    CHECK(joint_position(world.scene, slide) == Approx(0.05 * turned + 0.1).margin(0.01));
  }
  CHECK(turned > 3.0 * 2.0 * kPi);
}

TEST_CASE("joints of several axes hold all but these, within their limits", "[physics_bullet]") {
  // Three turns with limits that no two of them share, thrown round: whatever way the axes are, the
  // leg stays at the hip, within them, and reaches some.
  const double degree = kPi / 180.0;
  const std::vector<std::pair<double, double>> limits{{-20, 35}, {-50, 10}, {-70, 45}};
  const auto hip_with = [&](PhysicsWorld& world, NodeId parent, NodeId child, int first_axis,
                            bool is_left_handed, std::size_t count) {
    const NodeId hip = world.scene.create(world.scene.root(), "hip");
    Affine world_from_joint = tilted(0.2, -0.1, 2.0, 0.6, Vec3(1, 2, -1).normalized());
    world.scene.set_pose(hip, at(3, 2, 1));
    std::vector<NodeId> joints;
    for (std::size_t i = 0; i < count; ++i) {
      const NodeId id = world.scene.create(hip, "turn" + std::to_string(i));
      world.scene.set_pose(id, world.scene.world_from_node(hip).inverse() * world_from_joint);
      Joint joint;
      joint.kind = JointKind::Revolute;
      joint.axis = Vec3::Unit((first_axis + int(i)) % 3);
      if (is_left_handed && i == 1) joint.axis = -joint.axis;
      joint.lower = limits[i].first * degree;
      joint.upper = limits[i].second * degree;
      joint.parent_body = joints.empty() ? parent : joints.back();
      joint.child_body = i + 1 < count ? id : child;
      if (i == 0) {
        joint.parent_from_joint = world.scene.world_from_node(parent).inverse() * world_from_joint;
      }
      if (i + 1 == count) {
        joint.child_from_joint = world.scene.world_from_node(child).inverse() * world_from_joint;
      }
      world.scene.edit(id).joint = joint;
      joints.push_back(id);
    }
    return joints;
  };
  for (const std::size_t count : {2, 3}) {
    for (const int first_axis : {0, 1, 2}) {
      for (const bool is_left_handed : {false, true}) {
        PhysicsWorld world;
        const NodeId hook = world.scene.create(world.scene.root(), "hook");
        const NodeId leg = world.add_primitive("leg", PrimitiveShape::Box, Vec3(0.1, 0.1, 0.6),
                                               at(0.2, -0.1, 1.7));
        world.make_body(leg, 2.0);
        const auto joints = hip_with(world, hook, leg, first_axis, is_left_handed, count);
        REQUIRE(compound_joints(world.scene).size() == 1);
        const Vec3 hold = world.scene.world_from_node(leg).inverse() * Vec3(0.2, -0.1, 2.0);
        std::vector<double> reached(2 * count, 0.0);
        for (int throw_of = 0; throw_of < 4; ++throw_of) {
          const double angle = 1.6 * throw_of + 0.4 * first_axis;
          world.scene.set_velocity(
              leg, Vec3::Zero(),
              9.0 * Vec3(std::cos(angle), std::sin(angle), throw_of % 2 ? 0.8 : -0.8));
          world.backend.reset(world.scene);
          for (int step = 0; step < 40; ++step) {
            world.backend.advance(world.scene, 1);
            CAPTURE(count, first_axis, is_left_handed, throw_of, step);
            CHECK((world.scene.world_from_node(leg) * hold - Vec3(0.2, -0.1, 2.0)).norm() < 0.02);
            for (std::size_t i = 0; i < count; ++i) {
              const double now = joint_position(world.scene, joints[i]) / degree;
              CHECK(now > limits[i].first - 6.0);
              CHECK(now < limits[i].second + 6.0);
              reached[2 * i] = std::min(reached[2 * i], now);
              reached[2 * i + 1] = std::max(reached[2 * i + 1], now);
            }
          }
        }
        // They are the limits of these axes, not of others or turned round.
        double stops = 0;
        for (std::size_t i = 0; i < count; ++i) {
          if (reached[2 * i] < limits[i].first + 3.0) ++stops;
          if (reached[2 * i + 1] > limits[i].second - 3.0) ++stops;
        }
        CHECK(stops >= 2);
      }
    }
  }
}

TEST_CASE("limits of several axes hold wherever they lie", "[physics_bullet]") {
  const double degree = kPi / 180.0;
  using Limits = std::vector<std::pair<double, double>>;
  const double none = kInfinity;
  struct Case {
    Limits limits;
    std::vector<bool> is_held;  ///< Bullet knows nothing of the others.
  };
  const std::vector<Case> cases{
      {{{100, 250}, {-40, 30}, {-250, -120}}, {true, true, true}},
      {{{100, 250}, {-100, 10}}, {true, true}},
      {{{-100, 10}, {100, 250}}, {true, true}},
      {{{-20, 35}, {103, 143}, {-70, 45}}, {true, true, true}},
      {{{150, 200}, {-250, -200}, {330, 400}}, {true, true, true}},
      {{{-42, 42}, {-none, none}, {-none, none}}, {false, true, true}},
      {{{-42, 42}, {-110, 5}, {-20, 20}}, {false, false, false}},
      {{{-42, 42}, {60, 140}, {-20, 20}}, {false, false, false}},
  };
  for (std::size_t number = 0; number < cases.size(); ++number) {
    const auto& [limits, is_held] = cases[number];
    PhysicsWorld world;
    const NodeId hook = world.scene.create(world.scene.root(), "hook");
    const NodeId ball =
        world.add_primitive("ball", PrimitiveShape::Box, Vec3(0.3, 0.3, 0.3), at(0, 0, 1));
    world.make_body(ball, 1.0);
    world.scene.edit(ball).rigid_body->has_gravity = false;
    std::vector<NodeId> joints;
    for (std::size_t i = 0; i < limits.size(); ++i) {
      const NodeId id = world.scene.create(world.scene.root(), "turn" + std::to_string(i));
      world.scene.set_pose(id, at(0, 0, 1));
      Joint joint;
      joint.kind = JointKind::Revolute;
      joint.axis = (i == 1 ? -1.0 : 1.0) * Vec3::Unit(int(i));
      joint.lower = limits[i].first * degree;
      joint.upper = limits[i].second * degree;
      joint.parent_body = i == 0 ? hook : joints.back();
      joint.child_body = i + 1 < limits.size() ? id : ball;
      if (i == 0) joint.parent_from_joint = at(0, 0, 1);
      world.scene.edit(id).joint = joint;
      joints.push_back(id);
    }
    REQUIRE(compound_joints(world.scene).size() == 1);
    for (int draw = 0; draw < 12; ++draw) {
      CAPTURE(number, draw);
      std::vector<JointTarget> targets;
      for (std::size_t i = 0; i < limits.size(); ++i) {
        const double share = 0.05 + 0.9 * std::fmod((0.38 + 0.21 * double(i)) * (draw + 1), 1.0);
        const double lower = std::isfinite(limits[i].first) ? limits[i].first : -180.0;
        const double upper = std::isfinite(limits[i].second) ? limits[i].second : 180.0;
        targets.push_back({joints[i], (lower + share * (upper - lower)) * degree});
      }
      pose_joints(world.scene, targets);
      // What is within its limits stays.
      const Quat before(Mat3(world.scene.world_from_node(ball).linear()));
      world.scene.set_velocity(ball, Vec3::Zero(), Vec3::Zero());
      world.backend.reset(world.scene);
      world.backend.advance(world.scene, 5);
      const Quat after(Mat3(world.scene.world_from_node(ball).linear()));
      CHECK(before.angularDistance(after) < 0.02);
      // What is thrown stays within them.
      world.scene.set_velocity(
          ball, Vec3::Zero(),
          4.0 * Vec3(std::cos(1.0 * draw), std::sin(1.0 * draw), std::cos(2.3 * draw)));
      world.backend.reset(world.scene);
      for (int step = 0; step < 20; ++step) {
        world.backend.advance(world.scene, 1);
        for (std::size_t i = 0; i < limits.size(); ++i) {
          if (!is_held[i]) continue;
          CAPTURE(step, i);
          if (!std::isfinite(limits[i].first)) continue;
          const double now = joint_position(world.scene, joints[i]) / degree;
          const double middle = 0.5 * (limits[i].first + limits[i].second);
          CHECK(std::abs(std::remainder(now - middle, 360.0)) < limits[i].second - middle + 8.0);
        }
      }
    }
  }
}

TEST_CASE("frames of chains that are none of several axes hold nothing", "[physics_bullet]") {
  PhysicsWorld world;
  const NodeId box =
      world.add_primitive("box", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(0, 0, 2));
  const NodeId lost =
      world.add_primitive("lost", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(1, 0, 2));
  const NodeId other =
      world.add_primitive("other", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(2, 0, 2));
  for (const NodeId body : {box, lost, other}) world.make_body(body);
  const auto chain = [&](NodeId parent, NodeId child, const Vec3& second_axis) {
    const NodeId frame = world.scene.create(world.scene.root(), "frame");
    world.scene.set_pose(frame, world.scene.world_from_node(parent));
    Joint joint;
    joint.kind = JointKind::Revolute;
    joint.axis = Vec3::UnitX();
    joint.parent_body = parent;
    joint.child_body = frame;
    world.scene.edit(frame).joint = joint;
    const NodeId end = join(world, JointKind::Revolute, frame, child,
                            world.scene.world_from_node(parent), second_axis);
    return end;
  };
  chain(box, lost, Vec3::UnitY());
  chain(box, other, Vec3(1, 1, 0).normalized());
  world.scene.erase(lost);
  world.run(30);
  CHECK(world.position(box).z() < 1.0);
  CHECK(world.position(other).z() < 1.0);
}

TEST_CASE("a thing on a planar joint slides and turns in its plane", "[physics_bullet]") {
  PhysicsWorld world;
  const NodeId base = world.scene.create(world.scene.root(), "base");
  const double lean = 0.3;
  const NodeId puck = world.add_primitive("puck", PrimitiveShape::Box, Vec3(0.2, 0.1, 0.05),
                                          tilted(0, 0, 1, lean, Vec3::UnitX()));
  world.make_body(puck);
  const Affine plane = tilted(0, 0, 1, lean, Vec3::UnitX());
  std::vector<NodeId> joints;
  const std::vector<JointKind> kinds{JointKind::Prismatic, JointKind::Prismatic,
                                     JointKind::Revolute};
  for (int i = 0; i < 3; ++i) {
    const NodeId id = world.scene.create(world.scene.root(), "joint");
    world.scene.set_pose(id, plane);
    Joint joint;
    joint.kind = kinds[std::size_t(i)];
    joint.axis = Vec3::Unit(i);
    joint.parent_body = i == 0 ? base : joints.back();
    joint.child_body = i == 2 ? puck : id;
    if (i == 0) joint.parent_from_joint = plane;
    if (i == 0) joint.lower = -0.1;
    if (i == 0) joint.upper = 0.05;
    world.scene.edit(id).joint = joint;
    joints.push_back(id);
  }
  world.scene.set_velocity(puck, Vec3(2.0, 0, 0), plane.linear() * Vec3(0, 0, 3.0));
  world.run(30);
  const Affine plane_from_puck = plane.inverse() * world.scene.world_from_node(puck);
  CHECK(std::abs(plane_from_puck.translation().z()) < 0.005);
  CHECK(Vec3(plane_from_puck.linear().col(2)).isApprox(Vec3::UnitZ(), 0.01));
  // Down the slope as far as it fell, along it to the limit, and turned on.
  CHECK(joint_position(world.scene, joints[0]) == Approx(0.05).margin(0.005));
  CHECK(joint_position(world.scene, joints[1]) ==
        Approx(-0.5 * 9.81 * std::sin(lean) * 0.25).epsilon(0.06));
  CHECK(joint_position(world.scene, joints[2]) == Approx(1.5).margin(0.15));
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
