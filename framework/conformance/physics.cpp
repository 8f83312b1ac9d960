// SPDX-License-Identifier: Apache-2.0
#include <exception>
#include <thread>

#include "diorama/physics_backend.h"
#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

constexpr int kSteps = 20;

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
  std::exception_ptr error;
  Scene by_second;
  std::thread other([&] {
    try {
      by_second = simulated(*second);
    } catch (...) {
      error = std::current_exception();
    }
  });
  Scene by_first;
  try {
    by_first = simulated(*first);
  } catch (...) {
    error = std::current_exception();
  }
  other.join();
  if (error) std::rethrow_exception(error);
  require_same(alone, by_first, "differs while another instance is at work");
  require_same(alone, by_second, "differs while another instance is at work");
}

double height(const Scene& scene, const char* path) {
  return scene.world_from_node(scene.require(path)).translation().z();
}

void check_falling(const Subject& subject) {
  const Scene before = sample_scene();
  const Scene after = simulated(subject, subject.host);
  require(height(after, "/Assets/box") < height(before, "/Assets/box") - 1e-3,
          "a body in the air does not fall");
  require(height(after, "/Assets/box") > -0.2, "a body falls through the floor");
  for (const std::string& path : changed_nodes(before, after)) {
    require(path == "/Assets/box" || path == "/Assets/pair",
            "changes " + path + ", which is no body");
  }
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
