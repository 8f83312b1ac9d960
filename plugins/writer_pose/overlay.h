// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "writer_pose/pose_data.h"

namespace diorama {

/// Draws cuboids, keypoints and axes over the frame's picture: front face red, back blue, edges
/// between them green; axes x red, y green, z blue; the world's axes at the bottom left.
Image<Rgba8> draw_overlay(const Frame& frame, const std::vector<ObjectPose>& objects,
                          PoseLayout layout);

}  // namespace diorama
