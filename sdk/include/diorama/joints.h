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

/// What holds two bodies and moves along or about several axes: joints of one axis each, in a chain
/// from the parent to the child, with frames between them (see Joint::child_body). Slides come
/// first, then turns; all are in one place, and along or about axes that stand at right angles.
struct CompoundJoint {
  std::vector<NodeId> joints;  ///< At least two. All but the last are frames.
  /// Right-handed columns, in joint space. The first turn is about the third of them, the second
  /// about the second, the third about the first, either way round; slides are along any.
  Mat3 axes = Mat3::Identity();
};

/// In creation order of their last joints. Chains that are not of that kind are none.
DIORAMA_SDK_API std::vector<CompoundJoint> compound_joints(const Scene& scene);

/// Places the frames by where the bodies are, so that each joint has its share of their motion:
/// within its limits where two answers are equal. What the joints do not allow (play of a
/// simulation) is left over at the end.
DIORAMA_SDK_API void place_frames(Scene& scene, const CompoundJoint& compound);

}  // namespace diorama
