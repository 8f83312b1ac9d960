// SPDX-License-Identifier: Apache-2.0
#include "rigid_motion.h"

#include <algorithm>

namespace diorama {

Affine RigidMotion::then_from_now(double seconds) const {
  Affine map = Affine::Identity();
  const double speed = angular.norm();
  if (speed > 0.0) map.linear() = Mat3(Eigen::AngleAxisd(speed * seconds, angular / speed));
  map.translation() = centre + linear * seconds - map.linear() * centre;
  return map;
}

bool RigidMotion::moves(const Aabb& box, double seconds) const {
  constexpr double kLeast = 1e-5;  // metres
  double radius = 0.0;
  for (int i = 0; i < 8; ++i) radius = std::max(radius, (box.corner(i) - centre).norm());
  return (linear.norm() + angular.norm() * radius) * seconds > kLeast;
}

RigidMotion body_motion(const Scene& scene, NodeId node) {
  while (node && !scene[node].rigid_body) node = scene[node].parent;
  if (!node) return {};
  const RigidBody& body = *scene[node].rigid_body;
  return {scene.world_from_node(node).translation(), body.linear_velocity, body.angular_velocity};
}

double shutter_window(const Scene& scene) {
  double window = 0.0;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (!scene[node].camera) continue;
    const Camera& camera = *scene[node].camera;
    window = std::max(window, camera.exposure_time_s + camera.readout_time_s);
  }
  return window;
}

}  // namespace diorama
