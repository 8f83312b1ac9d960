// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diorama/frame.h"
#include "writer_support/python_json.h"

namespace diorama {

/// A mask as COCO keeps it: lengths of runs of zeros and ones by turns, zeros first, down the
/// columns from the left.
struct RunLength {
  int width = 0;
  int height = 0;
  std::vector<std::uint32_t> counts;
};

/// The pixels of `id` in an image of ids, all of which lie inside `box`.
RunLength run_length(const Image<std::uint32_t>& ids, std::uint32_t id, const PixelBox& box);
/// A coverage mask that lies inside the image.
RunLength run_length(const CoverageMask& mask, int image_width, int image_height);

/// {"size": [height, width], "counts": "..."} with the compressed text of the COCO API: each count
/// as its difference to the one before the previous (from the fourth on), in groups of five bits
/// from the lowest, bit 6 meaning "more follows", shifted by 48 into printable characters.
Json coco_rle(const RunLength& mask);

}  // namespace diorama
