// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/physics_backend.h"

namespace diorama {

/// Rigid bodies by Bullet. Friction and restitution of two touching bodies are the geometric mean
/// of theirs; a body of several colliders takes the surface of the first. Masses are spread evenly
/// over the volume of the colliders, so the centre of mass is theirs, not the node's origin. Bodies
/// start with the velocities that the scene says; bodies that overlap are pushed apart without
/// gaining speed.
class BulletBackend final : public PhysicsBackend {
 public:
  struct Params {
    double step_seconds = 1.0 / 60.0;
    int sub_steps = 2;
    Vec3 gravity{0.0, 0.0, -9.81};
    double linear_damping = 0.0;
    double angular_damping = 0.05;
    double floating_damping = 0.95;
    double rolling_friction = 0.02;
    int solver_iterations = 50;
    bool ccd = true;
    double margin_m = 0.0005;
    double max_depenetration_speed = 2.0;
    double sleep_speed = 0.02;
    int hull_vertices = 64;
    bool hidden_collide = true;

    void visit(ParamVisitor& v);
  };

  BulletBackend(Params params, Host& host);
  ~BulletBackend() override;

  double step_seconds() const override { return params_.step_seconds; }
  PhysicsReport report() const override;

 private:
  struct World;

  void do_reset(const Scene& scene) override;
  void do_advance(int steps) override;
  bool do_advance_by(int steps, double step_s) override;
  void do_write_poses(Scene& scene) const override;
  void do_carry(const Scene& scene, double seconds) override;

  Params params_;
  Host& host_;
  std::unique_ptr<World> world_;
};

}  // namespace diorama
