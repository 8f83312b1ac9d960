// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/scene.h"

namespace diorama {

/// Steady motion of a rigid thing through the moment of the scene's poses. World space.
struct RigidMotion {
  Vec3 centre = Vec3::Zero();   ///< The point whose velocity is `linear`.
  Vec3 linear = Vec3::Zero();   ///< m/s
  Vec3 angular = Vec3::Zero();  ///< rad/s

  /// From where a point is at the moment to where it is `seconds` later (earlier if negative).
  Affine then_from_now(double seconds) const;
  /// Whether anything in the box moves by more than a hundredth of a millimetre.
  bool moves(const Aabb& box, double seconds) const;
};

/// The motion of the nearest rigid body at or above the node; none at rest without one.
RigidMotion body_motion(const Scene& scene, NodeId node);

/// Seconds over which the cameras of the scene gather light, the longest of them; around the moment
/// of its poses.
double shutter_window(const Scene& scene);

}  // namespace diorama
