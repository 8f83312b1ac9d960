// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/camera.h"

namespace diorama {

/// Pixel of a camera-space point by the formulas of Replicator's PoseWriter: never refuses a point
/// (what lies behind a pinhole is mirrored), and leaves the distortion of OpenCV lenses out.
Vec2 replicator_project(const Camera& camera, const Vec3& point_camera);

}  // namespace diorama
