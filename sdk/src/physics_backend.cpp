// SPDX-License-Identifier: Apache-2.0
#include "diorama/physics_backend.h"

#include <cmath>
#include <string>

#include "diorama/error.h"

namespace diorama {

namespace {

void check_body(const Scene& scene, NodeId id) {
  const Node& node = scene[id];
  if (!node.rigid_body) return;
  const bool is_finite = node.parent_from_node.matrix().allFinite() &&
                         node.rigid_body->linear_velocity.allFinite() &&
                         node.rigid_body->angular_velocity.allFinite();
  if (is_finite) return;
  throw Error(ErrorKind::Internal, "the simulation of " + scene.path(id) +
                                       " broke down: its pose or velocity is not finite");
}

}  // namespace

PhysicsBackend::~PhysicsBackend() = default;

void PhysicsBackend::reset(const Scene& scene) { do_reset(scene); }

bool PhysicsBackend::do_advance_by(int, double) { return false; }

void PhysicsBackend::do_carry(const Scene&, double) {}

void PhysicsBackend::carry(const Scene& scene, double seconds) {
  if (!(seconds > 0.0)) {
    throw Error(ErrorKind::Internal, "PhysicsBackend::carry: expected a time above 0 s, found " +
                                         std::to_string(seconds));
  }
  do_carry(scene, seconds);
}

void PhysicsBackend::advance(Scene& scene, int steps) { advance(scene, steps, step_seconds()); }

void PhysicsBackend::advance(Scene& scene, int steps, double step_s) {
  if (steps < 0) {
    throw Error(ErrorKind::Internal, "PhysicsBackend::advance: expected 0 steps or more, found " +
                                         std::to_string(steps));
  }
  const double own_s = step_seconds();
  // 1 / 60 and half of 1 / 30 are one length.
  const bool is_own = std::abs(step_s - own_s) <= 1e-12 * own_s;
  if (steps > 0 && is_own) {
    do_advance(steps);
  } else if (steps > 0 && !do_advance_by(steps, step_s)) {
    throw Error(ErrorKind::Config, "steps of " + std::to_string(step_s) +
                                       " s are wanted, but this physics takes steps of " +
                                       std::to_string(own_s) + " s only");
  }
  do_write_poses(scene);
  for (const NodeId id : scene.subtree(scene.root())) check_body(scene, id);
}

}  // namespace diorama
