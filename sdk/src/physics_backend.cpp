// SPDX-License-Identifier: Apache-2.0
#include "diorama/physics_backend.h"

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

void PhysicsBackend::advance(Scene& scene, int steps) {
  if (steps < 0) {
    throw Error(ErrorKind::Internal, "PhysicsBackend::advance: expected 0 steps or more, found " +
                                         std::to_string(steps));
  }
  if (steps > 0) do_advance(steps);
  do_write_poses(scene);
  for (const NodeId id : scene.subtree(scene.root())) check_body(scene, id);
}

}  // namespace diorama
