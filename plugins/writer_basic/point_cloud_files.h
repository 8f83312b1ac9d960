// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "writer_basic/frame_output.h"

namespace diorama {

/// One point per pixel with a surface, from the top left, in world space: positions, colours,
/// normals and the ids of the segmentation pictures. Unlabelled surfaces only on request.
void write_point_cloud(const FrameOutput& output, bool include_unlabelled);

}  // namespace diorama
