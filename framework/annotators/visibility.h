// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <span>

#include "diorama/frame.h"

namespace diorama {

/// How often each id but 0 occurs in an id channel.
std::map<std::uint32_t, std::int64_t> count_pixels(const Image<std::uint32_t>& ids);

/// Fills Instance::visibility of every instance. Needs kInstanceId and Frame::instances, so call it
/// after the annotators `instance_ids` and `instances`. `coverage` is what Renderer::cover() gives
/// for labelled_instances(), which has the order of Frame::instances. With `keep_masks` the masks
/// stay in Visibility::amodal_mask, cropped to what lies inside the image.
/// Throws what check_coverage() throws.
void measure_visibility(std::span<const CoverageMask> coverage, bool keep_masks, Frame& frame);

/// Throws Error(Internal) unless there is one mask per instance and each fills its box.
void check_coverage(std::span<const CoverageMask> coverage, const Frame& frame);

}  // namespace diorama
