// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "writer_basic/frame_output.h"

namespace diorama {

/// Extent of the visible pixels; instances without any are absent.
void write_bounding_box_2d_tight(const FrameOutput& output);
/// Extent inside the image as if nothing else were in the scene.
void write_bounding_box_2d_loose(const FrameOutput& output);
/// Boxes in node space with the node's pose, of what lies in the image, hidden or not.
void write_bounding_box_3d(const FrameOutput& output);
/// Instance id, semantic id and occlusion ratio of what lies in the image.
void write_occlusion(const FrameOutput& output);

}  // namespace diorama
