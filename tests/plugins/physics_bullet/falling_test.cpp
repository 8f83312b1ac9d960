// SPDX-License-Identifier: Apache-2.0
#include "physics_world.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

NodeId add_ball(PhysicsWorld& world, const std::string& name, const Affine& pose,
                double radius = 0.05) {
  const NodeId ball =
      world.add_primitive(name, PrimitiveShape::Sphere, Vec3::Constant(2 * radius), pose);
  world.make_body(ball);
  return ball;
}

}  // namespace

TEST_CASE("free fall follows the closed form", "[physics]") {
  BulletBackend::Params params;
  params.sub_steps = 4;
  PhysicsWorld world(params);
  const NodeId ball = add_ball(world, "ball", at(1, -2, 30));
  world.run(60);
  // n equal steps of semi-implicit Euler add up to g h^2 n (n + 1) / 2.
  const double h = 1.0 / 240.0;
  CHECK(world.position(ball).z() == Approx(30 - 9.81 * h * h * 240 * 241 / 2).epsilon(1e-12));
  CHECK(world.position(ball).z() == Approx(30 - 0.5 * 9.81).margin(0.5 * 9.81 * h + 1e-9));
  CHECK(world.position(ball).x() == 1.0);
  CHECK(world.scene[ball].rigid_body->linear_velocity.z() == Approx(-9.81).epsilon(1e-9));
  CHECK(world.backend.report().max_speed == Approx(9.81).epsilon(1e-9));
}

TEST_CASE("a body starts with the velocity that the scene says, and goes on with it after a reset",
          "[physics]") {
  BulletBackend::Params params;
  params.floating_damping = 0.0;
  PhysicsWorld world(params);
  // The centre of mass is off the node's origin, which moves in a circle about it.
  const NodeId body = world.scene.create(world.scene.root(), "body");
  world.scene.set_pose(body, at(1, -2, 30));
  const NodeId arm = world.scene.create(body, "arm");
  world.scene.set_pose(arm, at(0.5, 0, 0));
  Collider& collider = world.scene.edit(arm).collider.emplace();
  collider.shape = ColliderShape::Primitive;
  collider.primitive = PrimitiveShape::Box;
  collider.primitive_size = Vec3(0.2, 0.1, 0.1);
  RigidBody& moving = world.scene.edit(body).rigid_body.emplace();
  moving.has_gravity = false;
  moving.angular_velocity = Vec3(0, 0, kPi);
  // That of the origin; the centre of mass then moves along z alone.
  moving.linear_velocity = Vec3(0, -0.5 * kPi, 2.0);
  world.backend.reset(world.scene);
  world.backend.advance(world.scene, 30);
  CHECK((world.position(body) - Vec3(1.5, -2.5, 31)).norm() < 0.01);
  world.backend.reset(world.scene);
  world.backend.advance(world.scene, 30);
  CHECK((world.position(body) - Vec3(2, -2, 32)).norm() < 0.02);
}

TEST_CASE("restitution sends a ball back to its square of the height", "[physics]") {
  for (const double restitution : {0.0, 0.5, 0.8}) {
    PhysicsWorld world;
    const NodeId floor = world.add_floor();
    const NodeId ball = add_ball(world, "ball", at(0.1, 0.2, 1.05));
    world.scene.edit(floor).collider->restitution = restitution;
    world.scene.edit(ball).collider->restitution = restitution;
    world.backend.reset(world.scene);
    double highest = 0.0;
    bool has_landed = false;
    for (int i = 0; i < 120; ++i) {
      world.backend.advance(world.scene, 1);
      const double gap = world.position(ball).z() - 0.05;
      has_landed = has_landed || world.scene[ball].rigid_body->linear_velocity.z() > -0.1;
      if (has_landed && i > 20) highest = std::max(highest, gap);
    }
    REQUIRE(has_landed);
    // A step of 1/120 s at 4.4 m/s leaves the moment of touch open by 4 cm of fall.
    CHECK(highest == Approx(restitution * restitution).margin(0.06));
  }
}

TEST_CASE("a box on a slope stays below the angle of friction and slides above it", "[physics]") {
  const double friction = 0.5;  // geometric mean of 1.0 and 0.25
  for (const double tangent : {0.4, 0.6}) {
    PhysicsWorld world;
    const double angle = std::atan(tangent);
    const Affine slope(Eigen::AngleAxisd(angle, Vec3::UnitY()));
    const NodeId plane =
        world.add_primitive("slope", PrimitiveShape::Box, Vec3(40, 40, 1), slope * at(0, 0, -0.5));
    const NodeId box = world.add_primitive("box", PrimitiveShape::Box, Vec3(0.4, 0.3, 0.1),
                                           slope * at(0, 0, 0.05));
    world.make_body(box, 3.0);
    world.scene.edit(plane).collider->friction = 1.0;
    world.scene.edit(box).collider->friction = 0.25;
    world.run(60);
    const double way = (world.position(box) - slope * Vec3(0, 0, 0.05)).norm();
    if (tangent < friction) {
      CHECK(way < 0.005);
    } else {
      const double slip = 9.81 * (std::sin(angle) - friction * std::cos(angle));
      CHECK(way == Approx(0.5 * slip).epsilon(0.08));
    }
  }
}

TEST_CASE("a stack of boxes stays upright and falls asleep", "[physics]") {
  PhysicsWorld world;
  world.add_floor();
  std::vector<NodeId> boxes;
  for (int i = 0; i < 6; ++i) {
    boxes.push_back(world.add_primitive("box", PrimitiveShape::Box, Vec3(0.2, 0.15, 0.1),
                                        at(0.3, -0.4, 0.05 + 0.1 * i)));
    world.make_body(boxes.back(), 0.5);
  }
  world.run(400);
  for (int i = 0; i < 6; ++i) {
    CHECK((world.position(boxes[std::size_t(i)]) - Vec3(0.3, -0.4, 0.05 + 0.1 * i)).norm() < 0.001);
  }
  const PhysicsReport report = world.backend.report();
  CHECK(report.moving_bodies == 6);
  CHECK(report.sleeping_bodies == 6);
  CHECK(report.max_speed == 0.0);
  CHECK(report.max_penetration_m < 0.001);
}

TEST_CASE("a floating body stays, and drifts to a stop when pushed", "[physics]") {
  PhysicsWorld world;
  const NodeId alone =
      world.add_primitive("alone", PrimitiveShape::Box, Vec3(0.1, 0.2, 0.3), at(-3, 1, 2));
  world.make_body(alone, 1.0, false);
  const NodeId hit = add_ball(world, "hit", at(0, 0, 1));
  world.scene.edit(hit).rigid_body->has_gravity = false;
  add_ball(world, "bullet", at(0.02, 0, 2));
  const Affine before = world.scene.world_from_node(alone);
  world.backend.reset(world.scene);
  world.backend.advance(world.scene, 60);
  CHECK(world.scene.world_from_node(alone).matrix() == before.matrix());
  CHECK(world.position(hit).z() < 0.99);  // it was pushed
  world.backend.advance(world.scene, 540);
  const Vec3 rested = world.position(hit);
  CHECK(rested.z() > -3.0);
  world.backend.advance(world.scene, 600);
  CHECK((world.position(hit) - rested).norm() < 1e-3);
}

TEST_CASE("a ball on a level floor rolls to a stop", "[physics]") {
  PhysicsWorld world;
  world.add_floor();
  const Affine ramp_pose = at(-1, 0, 0.1) * Eigen::AngleAxisd(0.2, Vec3::UnitY());
  world.add_primitive("ramp", PrimitiveShape::Box, Vec3(0.8, 1, 0.02), ramp_pose);
  const NodeId ball = add_ball(world, "ball", ramp_pose * at(0, 0, 0.07));
  world.run(60 * 8);
  const Vec3 rested = world.position(ball);
  CHECK(rested.x() > -0.5);  // it rolled down
  world.backend.advance(world.scene, 120);
  CHECK((world.position(ball) - rested).norm() < 1e-3);
}

TEST_CASE("velocities are those of the node's origin, wherever the mass is", "[physics]") {
  // A box whose node stands 0.6 m beside it tips over the edge of a table.
  BulletBackend::Params params;
  params.sub_steps = 8;
  PhysicsWorld world(params);
  world.add_primitive("table", PrimitiveShape::Box, Vec3(1, 1, 1), at(0, 0, 0.5));
  const NodeId body = world.scene.create(world.scene.root(), "body");
  world.scene.set_pose(body, at(1.25, 0, 1.1));
  const NodeId box = world.scene.create(body, "box");
  world.scene.edit(box).collider =
      Collider{ColliderShape::Primitive, PrimitiveShape::Box, Vec3(0.4, 0.3, 0.2)};
  world.scene.set_pose(box, at(-0.6, 0, 0));
  world.make_body(body);
  world.backend.reset(world.scene);
  bool has_turned = false;
  for (int i = 0; i < 60; ++i) {
    const Vec3 before = world.position(body);
    world.backend.advance(world.scene, 1);
    const RigidBody& now = *world.scene[body].rigid_body;
    // In the open air, a step turns things by little.
    if (now.angular_velocity.norm() < 1.5 || world.position(body).z() < 0.5) continue;
    has_turned = true;
    const Vec3 measured = (world.position(body) - before) * 60.0;
    // A step speeds things up by some 0.2 m/s; the centre of mass moves otherwise by 0.9 m/s.
    CHECK((now.linear_velocity - measured).norm() < 0.3);
  }
  CHECK(has_turned);
}

TEST_CASE("what is carried pushes bodies, lifts them and stands still again", "[physics]") {
  BulletBackend::Params params;
  params.step_seconds = 1.0 / 100.0;
  PhysicsWorld world(params);
  world.add_floor();
  // A wall of triangles, a lift, and what asleep lies on it.
  Mesh plate = make_box(Vec3(0.1, 2, 2));
  const NodeId wall = world.add("wall", shared(plate), ColliderShape::TriangleMesh, at(-1, 0, 1));
  const NodeId lift =
      world.add_primitive("lift", PrimitiveShape::Box, Vec3(1, 1, 0.1), at(5, 0, 1));
  const NodeId ball = add_ball(world, "ball", at(-0.7, 0, 0.05));
  // It rubs on the floor, and is thinner than the way that the wall takes.
  const NodeId block =
      world.add_primitive("block", PrimitiveShape::Box, Vec3(0.1, 0.2, 0.2), at(-0.7, 0.5, 0.1));
  world.make_body(block);
  const NodeId load =
      world.add_primitive("load", PrimitiveShape::Box, Vec3(0.2, 0.2, 0.2), at(5, 0.2, 1.15));
  world.make_body(load);
  world.backend.reset(world.scene);
  world.backend.advance(world.scene, 300);
  CHECK(world.backend.report().sleeping_bodies == 3);
  CHECK(world.position(load).z() == Approx(1.15).margin(2e-3));
  // In frames of 4 steps: 1 m/s, and the lift rises and turns.
  double deepest = 0.0;
  for (int frame = 1; frame <= 25; ++frame) {
    world.scene.set_pose(wall, at(-1 + 0.04 * frame, 0, 1));
    world.scene.set_pose(
        lift, at(5, 0, 1 + 0.02 * frame) * Eigen::AngleAxisd(0.04 * frame, Vec3::UnitZ()));
    world.backend.carry(world.scene, 0.04);
    world.backend.advance(world.scene, 3);
    world.backend.advance(world.scene, 1);
    const double face = -1 + 0.04 * frame + 0.05;
    if (face > -0.7) CHECK(world.position(block).x() == Approx(face + 0.05).margin(0.01));
    deepest = std::max(deepest, -1 + 0.04 * frame + 0.05 + 0.05 - world.position(ball).x());
  }
  CHECK(deepest < 0.015);
  CHECK(world.position(ball).x() > 0.09);
  CHECK(world.position(load).z() == Approx(1.65).margin(5e-3));
  CHECK(world.scene[load].rigid_body->linear_velocity.z() == Approx(0.5).margin(0.05));
  // It turned with the lift about the lift's middle.
  CHECK((world.position(load) - Vec3(5 - 0.2 * std::sin(1.0), 0.2 * std::cos(1.0), 1.65)).norm() <
        0.02);
  // No more is carried: the ball rolls on, the load comes to rest on the lift.
  world.backend.advance(world.scene, 1000);
  CHECK(world.position(load).z() == Approx(1.65).margin(2e-3));
  CHECK(world.position(ball).x() > 0.2);
  CHECK(world.backend.report().sleeping_bodies == 3);
}

TEST_CASE("what is carried does so alike each time, and not at all where nothing moved",
          "[physics]") {
  PhysicsWorld world;
  const NodeId wall =
      world.add_primitive("wall", PrimitiveShape::Box, Vec3(0.1, 2, 2), at(-1, 0, 1));
  world.add_floor();
  std::vector<NodeId> balls;
  for (int i = 0; i < 8; ++i) {
    balls.push_back(
        add_ball(world, "ball" + std::to_string(i), at(-0.6 + 0.02 * i, 0, 0.1 + 0.12 * i)));
  }
  const auto run = [&](double speed, bool carries) {
    world.scene.set_pose(wall, at(-1, 0, 1));
    for (std::size_t i = 0; i < balls.size(); ++i) {
      world.scene.set_pose(balls[i], at(-0.6 + 0.02 * double(i), 0, 0.1 + 0.12 * double(i)));
      world.scene.set_velocity(balls[i], Vec3::Zero(), Vec3::Zero());
    }
    world.backend.reset(world.scene);
    for (int frame = 1; frame <= 30; ++frame) {
      world.scene.set_pose(wall, at(-1 + speed * frame / 30.0, 0, 1));
      if (carries) world.backend.carry(world.scene, 1.0 / 30.0);
      world.backend.advance(world.scene, 2);
    }
    std::vector<double> places;
    for (const NodeId ball : balls) {
      const Vec3 place = world.position(ball);
      places.insert(places.end(), place.data(), place.data() + 3);
    }
    return places;
  };
  CHECK(run(1.0, true) == run(1.0, true));
  CHECK(run(1.0, true) != run(0.0, true));
  CHECK(run(0.0, true) == run(0.0, false));
  CHECK_THROWS_WITH(world.backend.carry(world.scene, 0.0),
                    ContainsSubstring("expected a time above 0 s"));
}
