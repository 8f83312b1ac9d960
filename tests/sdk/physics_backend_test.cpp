// SPDX-License-Identifier: Apache-2.0
#include "diorama/physics_backend.h"

#include <limits>

#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

/// Moves every body up by a metre per step, or breaks its speed.
class Lift final : public PhysicsBackend {
 public:
  bool breaks = false;
  int steps_taken = 0;
  double step_seconds() const override { return 0.1; }
  PhysicsReport report() const override { return {}; }

 private:
  void do_reset(const Scene&) override { steps_taken = 0; }
  void do_advance(int steps) override { steps_taken += steps; }
  void do_write_poses(Scene& scene) const override {
    for (const NodeId id : scene.subtree(scene.root())) {
      if (!scene[id].rigid_body) continue;
      scene.set_pose(id, Affine(Eigen::Translation3d(0, 0, steps_taken)));
      if (breaks) scene.edit(id).rigid_body->linear_velocity.y() = kInfinity;
    }
  }
};

}  // namespace

TEST_CASE("A backend advances by whole steps and writes poses", "[physics]") {
  Scene scene;
  const NodeId cup = scene.create(scene.root(), "cup");
  scene.edit(cup).rigid_body = RigidBody{};
  Lift lift;
  lift.reset(scene);
  lift.advance(scene, 3);
  lift.advance(scene, 0);
  CHECK(scene.world_from_node(cup).translation() == Vec3(0, 0, 3));
  CHECK(test::error_text([&] { lift.advance(scene, -1); }) ==
        "PhysicsBackend::advance: expected 0 steps or more, found -1");
}

TEST_CASE("A simulation that breaks down names the node", "[physics]") {
  Scene scene;
  scene.edit(scene.create(scene.root(), "cup")).rigid_body = RigidBody{};
  Lift lift;
  lift.breaks = true;
  lift.reset(scene);
  CHECK(test::error_text([&] { lift.advance(scene, 1); }) ==
        "the simulation of /cup broke down: its pose or velocity is not finite");
}

TEST_CASE("Steps of another length are taken where the backend can, and refused elsewhere",
          "[physics]") {
  Scene scene;
  scene.edit(scene.create(scene.root(), "cup")).rigid_body = RigidBody{};
  Lift lift;
  lift.reset(scene);
  // The same length, come to by another way.
  lift.advance(scene, 2, 0.3 / 3.0);
  CHECK(lift.steps_taken == 2);
  CHECK(test::error_text([&] { lift.advance(scene, 1, 0.05); }) ==
        "steps of 0.050000 s are wanted, but this physics takes steps of 0.100000 s only");
  CHECK(lift.steps_taken == 2);
}
