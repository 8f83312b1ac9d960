// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>

#include "diorama/frame.h"

namespace diorama {

/// How often each id but 0 occurs in an id channel.
std::map<std::uint32_t, std::int64_t> count_pixels(const Image<std::uint32_t>& ids);

/// Fills Instance::visibility, some instances after the others, so that few masks have to be there
/// at once: those of large pictures are large. Needs kInstanceId and Frame::instances, so call it
/// after the annotators `instance_ids` and `instances`. The frame has to stay where it is.
class VisibilityMeter {
 public:
  /// With `keep_masks` the masks stay in Visibility::amodal_mask, cropped to what lies inside the
  /// image.
  VisibilityMeter(bool keep_masks, Frame& frame);
  /// What Renderer::cover() gives for the next ones of labelled_instances(), which has the order of
  /// Frame::instances. Throws what check_coverage() throws.
  void add(std::span<const CoverageMask> coverage);

 private:
  bool keep_masks_;
  Frame& frame_;
  std::map<std::uint32_t, std::int64_t> visible_pixels_;
  std::size_t next_ = 0;
};

/// The same for all instances at once.
void measure_visibility(std::span<const CoverageMask> coverage, bool keep_masks, Frame& frame);

/// Throws Error(Internal) unless there is one mask per instance and each fills its box.
void check_coverage(std::span<const CoverageMask> coverage, const Frame& frame);

/// What of a mask lies inside the image: all that order_occlusions() looks at.
CoverageMask inside_image(CoverageMask mask, const Camera& camera);

}  // namespace diorama
