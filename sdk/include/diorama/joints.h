// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama {

/// Nodes with a joint whose bodies are in the scene, in creation order.
DIORAMA_SDK_API std::vector<NodeId> joints_of(const Scene& scene);

/// Where the joint stands by the poses of its bodies: radians or metres along its axis, 0 when it
/// is fixed. Of the angles that mean the same turn, one within the limits if there is such, else
/// that in (-pi, pi]. What the bodies do besides (play of a simulation) does not count.
DIORAMA_SDK_API double joint_position(const Scene& scene, NodeId joint);

/// Frame::joints of this scene.
DIORAMA_SDK_API std::vector<JointState> joint_states(const Scene& scene);

struct JointTarget {
  NodeId joint;
  double position = 0.0;  ///< Radians or metres; must be finite. Of no effect on fixed joints.
};

/// Puts joints at positions, whatever their limits: children follow their parents, exactly, through
/// all joints below, and bodies that nobody moves stay where they are. Joints that mimic a target
/// follow it; all others keep what their bodies do now. Where joints close a loop, the first
/// joint (by creation) that reaches a body counts; bodies of loops without a beginning stay.
DIORAMA_SDK_API void pose_joints(Scene& scene, std::span<const JointTarget> targets);

}  // namespace diorama
