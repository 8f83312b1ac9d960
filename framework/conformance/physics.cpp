// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "diorama/physics_backend.h"
#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/run_together.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

constexpr int kSteps = 20;
constexpr double kGravity = 9.81;
constexpr const char* kBox = "/Assets/box";
constexpr const char* kPair = "/Assets/pair";

Scene simulated(PhysicsBackend& physics) {
  Scene scene = sample_scene();
  physics.reset(scene);
  physics.advance(scene, kSteps);
  physics.advance(scene, kSteps);
  return scene;
}

Scene simulated(const Subject& subject, Host& host) {
  return simulated(*subject.make<PhysicsBackend>(host));
}

/// As visits in flight have it.
void check_two_at_once(const Subject& subject) {
  const Scene alone = simulated(subject, subject.host);
  const auto first = subject.make<PhysicsBackend>();
  const auto second = subject.make<PhysicsBackend>();
  Scene by_first;
  Scene by_second;
  run_together(2, [&](int thread) {
    (thread == 0 ? by_first : by_second) = simulated(thread == 0 ? *first : *second);
  });
  require_same(alone, by_first, "differs while another instance is at work");
  require_same(alone, by_second, "differs while another instance is at work");
}

double height(const Scene& scene, const char* path) {
  return scene.world_from_node(scene.require(path)).translation().z();
}

void check_falling(const Subject& subject) {
  const Scene before = sample_scene();
  constexpr double kSeconds = 1.5;  // Lies on the floor for long.
  const auto physics = subject.make<PhysicsBackend>();
  Scene after = sample_scene();
  physics->reset(after);
  physics->advance(after, int(std::clamp(kSeconds / physics->step_seconds(), 40.0, 1e5)));
  require(height(after, kBox) < height(before, kBox) - 1e-3, "a body in the air does not fall");
  require(height(after, kBox) > 0.0, "a body falls through the floor");
  for (const std::string& path : changed_nodes(before, after)) {
    require(path == kBox || path == kPair, "changes " + path + ", which is no body");
    const NodeId id = after.require(path);
    const RigidBody& body = *before[id].rigid_body;
    require(after[id].rigid_body.has_value(), "takes the body of " + path + " away");
    const Affine& pose = after[id].parent_from_node;
    require((pose.linear().transpose() * pose.linear()).isIdentity(1e-4),
            "changes the size of " + path);
    after.set_pose(id, before[id].parent_from_node);
    after.edit(id).rigid_body->linear_velocity = body.linear_velocity;
    after.edit(id).rigid_body->angular_velocity = body.angular_velocity;
  }
  require_same(before, after, "changes more than poses and velocities");
}

/// Steps in which the box comes nowhere near the floor.
int steps_in_the_air(const PhysicsBackend& physics) {
  constexpr double kSeconds = 0.2;  // 0.2 of its 0.7 m
  return std::max(1, int(kSeconds / physics.step_seconds()));
}

/// Whatever the method: of one that is as good as it can be without knowing what comes.
void check_free_fall(const Subject& subject) {
  const auto physics = subject.make<PhysicsBackend>();
  const int steps = steps_in_the_air(*physics);
  const double seconds = steps * physics->step_seconds();
  const Scene before = sample_scene();
  Scene after = sample_scene();
  physics->reset(after);
  physics->advance(after, steps);
  const NodeId box = after.require(kBox);
  const Vec3 way =
      after.world_from_node(box).translation() - before.world_from_node(box).translation();
  const double expected = 0.5 * kGravity * seconds * seconds;
  const double slack = expected * (1.0 / steps + 0.02);
  require(std::abs(-way.z() - expected) <= slack,
          "a body that falls for " + std::to_string(seconds) + " s falls " +
              std::to_string(-way.z()) + " m, expected about " + std::to_string(expected));
  require(std::hypot(way.x(), way.y()) < 1e-3 * expected, "a body that falls drifts sideways");
  const Eigen::Matrix3d turn =
      before.world_from_node(box).linear().transpose() * after.world_from_node(box).linear();
  require(turn.isIdentity(1e-3), "a body that falls freely turns");
  const double speed = -after[box].rigid_body->linear_velocity.z();
  require(std::abs(speed - kGravity * seconds) <= 0.02 * kGravity * seconds,
          "writes back a speed of " + std::to_string(speed) + " m/s, expected about " +
              std::to_string(kGravity * seconds));
}

/// A randomizer may throw things, and what falls goes on falling when the world is built anew.
void check_initial_velocity(const Subject& subject) {
  const auto physics = subject.make<PhysicsBackend>();
  const int steps = steps_in_the_air(*physics);
  const double seconds = steps * physics->step_seconds();
  constexpr double kSpeed = 1.0;
  Scene scene = sample_scene();
  const double before = height(scene, kBox);
  scene.edit(scene.require(kBox)).rigid_body->linear_velocity = Vec3(0, 0, kSpeed);
  physics->reset(scene);
  physics->advance(scene, steps);
  const double expected = kSpeed * seconds - 0.5 * kGravity * seconds * seconds;
  const double slack = 0.5 * kGravity * seconds * seconds / steps + 0.05 * kSpeed * seconds;
  require(std::abs(height(scene, kBox) - before - expected) <= slack,
          "a body whose velocity the scene says rises by " +
              std::to_string(height(scene, kBox) - before) + " m in " + std::to_string(seconds) +
              " s, expected about " + std::to_string(expected));
}

/// Up to rounding: poses may go through other numbers on the way into the scene.
void check_steps_add_up(const Subject& subject) {
  const auto physics = subject.make<PhysicsBackend>();
  const int steps = steps_in_the_air(*physics);
  Scene at_once = sample_scene();
  physics->reset(at_once);
  physics->advance(at_once, steps);
  Scene one_by_one = sample_scene();
  const auto other = subject.make<PhysicsBackend>();
  other->reset(one_by_one);
  for (int i = 0; i < steps; ++i) other->advance(one_by_one, 1);
  for (const char* path : {kBox, kPair}) {
    const double apart = (at_once.world_from_node(at_once.require(path)).translation() -
                          one_by_one.world_from_node(one_by_one.require(path)).translation())
                             .norm();
    require(apart < 1e-6, std::string(path) + " ends elsewhere, by " + std::to_string(apart) +
                              " m, when steps are taken one by one");
  }
}

void check_floating(const Subject& subject) {
  const auto physics = subject.make<PhysicsBackend>();
  Scene scene = sample_scene();
  scene.edit(scene.require(kBox)).rigid_body->has_gravity = false;
  const double before = height(scene, kBox);
  physics->reset(scene);
  physics->advance(scene, kSteps);
  require(std::abs(height(scene, kBox) - before) < 1e-6, "a body without gravity moves");
}

void check_report(const Subject& subject) {
  const auto physics = subject.make<PhysicsBackend>();
  Scene scene = sample_scene();
  physics->reset(scene);
  physics->advance(scene, steps_in_the_air(*physics));
  const PhysicsReport report = physics->report();
  require(report.moving_bodies == 2,
          "reports " + std::to_string(report.moving_bodies) + " moving bodies, expected 2");
  require(report.sleeping_bodies >= 0 && report.sleeping_bodies < 2,
          "reports " + std::to_string(report.sleeping_bodies) + " sleeping bodies while one falls");
  const double speed = scene[scene.require(kBox)].rigid_body->linear_velocity.norm();
  require(std::abs(report.max_speed - speed) <= 0.1 * speed,
          "reports a speed of " + std::to_string(report.max_speed) +
              " m/s at most, the fastest body has " + std::to_string(speed));
  require(std::isfinite(report.max_penetration_m) && report.max_penetration_m >= 0.0 &&
              report.max_penetration_m < 0.1,
          "reports a penetration of " + std::to_string(report.max_penetration_m) +
              " m where nothing is stuck");
  const std::set<std::string> bodies{"", kBox, kPair};
  require(bodies.contains(report.deepest_body),
          "names '" + report.deepest_body + "' as the deepest body, which is none");
}

}  // namespace

std::string physics_output(const Subject& subject) {
  return fingerprint(simulated(subject, subject.host));
}

void check_physics(const CheckRun& run, const Subject& subject) {
  run.check("an empty scene stays empty", [&] {
    const auto physics = subject.make<PhysicsBackend>();
    Scene scene;
    require(physics->step_seconds() > 0, "its steps take no time");
    physics->reset(scene);
    physics->advance(scene, 0);
    physics->advance(scene, 3);
    require(physics->report().moving_bodies == 0, "reports bodies that are not there");
  });
  run.check("reset and zero steps leave the scene as it is", [&] {
    const auto physics = subject.make<PhysicsBackend>();
    Scene scene = sample_scene();
    physics->reset(scene);
    physics->advance(scene, 0);
    require_same(sample_scene(), scene, "changes the scene");
  });
  run.check("bodies fall onto the floor, all else stays", [&] { check_falling(subject); });
  run.check("the same scene gives the same bits, for any number of threads", [&] {
    const Scene scene = simulated(subject, subject.host);
    require_same(scene, simulated(subject, subject.host), "differs the second time");
    require_same(scene, simulated(subject, subject.single_threaded_host),
                 "differs with one thread");
  });
  run.check("two instances at work at once give the same bits",
            [&] { check_two_at_once(subject); });
  run.check("a body falls as gravity and its steps have it", [&] { check_free_fall(subject); });
  run.check("a body starts with the velocity that the scene says",
            [&] { check_initial_velocity(subject); });
  run.check("steps add up, however many are taken at once", [&] { check_steps_add_up(subject); });
  run.check("a body without gravity stays where it is", [&] { check_floating(subject); });
  run.check("its report says what the bodies do", [&] { check_report(subject); });
  run.check("a reset forgets all that was", [&] {
    const auto fresh = subject.make<PhysicsBackend>();
    const auto used = subject.make<PhysicsBackend>();
    simulated(*used);
    Scene by_fresh = sample_scene();
    Scene by_used = sample_scene();
    fresh->reset(by_fresh);
    used->reset(by_used);
    const int steps = steps_in_the_air(*fresh);
    fresh->advance(by_fresh, steps);
    used->advance(by_used, steps);
    require_same(by_fresh, by_used, "differs after a reset");
  });
  run.check("a second scene after the first one was destroyed is survived", [&] {
    const auto physics = subject.make<PhysicsBackend>();
    for (int round = 0; round < 2; ++round) {
      Scene scene = sample_scene(round);
      physics->reset(scene);
      physics->advance(scene, 1);
    }
  });
}

}  // namespace diorama::conformance
