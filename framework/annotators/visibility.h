// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "diorama/frame.h"

namespace diorama {

/// Fills Instance::visibility of every instance. Needs kInstanceId and Frame::instances, so call it
/// after the annotators `instance_ids` and `instances`. `coverage` is what Renderer::cover() gives
/// for labelled_instances(), which has the order of Frame::instances. With `keep_masks` the masks
/// stay in Visibility::amodal_mask, cropped to what lies inside the image.
/// Throws Error(Internal) when the counts differ or a mask does not fill its box.
void measure_visibility(std::span<const CoverageMask> coverage, bool keep_masks, Frame& frame);

}  // namespace diorama
