// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>

#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama {

/// World poses of nodes with a RigidBody.
using BodyPoses = std::map<NodeId, Affine>;
BodyPoses body_poses(const Scene& scene);

/// Fills kMotion: how far the surface point in each pixel moved in the image since the bodies had
/// the poses `before`. A node moves rigidly with the nearest body at or above it, a camera too;
/// what has no entry in `before` stood still. Zero where the lens did not image the point before.
/// Needs kLeafId and kPosition.
void measure_motion(const Scene& scene, const BodyPoses& before, Frame& frame);

}  // namespace diorama
