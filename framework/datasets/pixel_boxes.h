// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>

#include "diorama/frame.h"

namespace diorama {

/// What a picture of ids shows of one object.
struct PixelExtent {
  PixelBox box{1 << 30, 1 << 30, 0, 0};
  std::int64_t pixels = 0;
};

/// By id, 0 left out.
std::map<std::uint32_t, PixelExtent> pixel_extents(const Image<std::uint32_t>& ids);

/// Objects without a tight box get that of their pixels, in frames that have a picture of ids.
void complete_boxes(Frame& frame);

}  // namespace diorama
