// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diorama/frame.h"
#include "reader_support/stored_files.h"

/// Masks of objects as formats keep them. Pixels of one mask lie in its box.
namespace diorama {

/// Larger pictures are refused before anything is allocated for them.
inline constexpr std::int64_t kMostPixels = std::int64_t(1) << 28;

/// COCO's {"size": [height, width], "counts": ...}, compressed or as a list. Throws
/// std::runtime_error when the runs do not fill a picture of this size.
CoverageMask mask_of_run_lengths(const Json& rle, int width, int height);

/// Pixels whose centres lie in one of the polygons (even-odd rule within each). Clipped to the
/// picture.
CoverageMask mask_of_polygons(const std::vector<std::vector<Vec2>>& polygons, int width,
                              int height);

std::int64_t pixel_count(const CoverageMask& mask);
/// Pixels that are in both.
std::int64_t shared_pixels(const CoverageMask& a, const CoverageMask& b);

/// An image of ids that masks are put into one by one.
class InstancePainter {
 public:
  InstancePainter(int width, int height) : ids_(width, height, 0) {}

  /// Returns how many pixels another mask has already; those stay.
  std::int64_t paint(const CoverageMask& mask, std::uint32_t id);
  bool has_overlaps() const { return has_overlaps_; }
  Image<std::uint32_t> take() { return std::move(ids_); }

 private:
  Image<std::uint32_t> ids_;
  bool has_overlaps_ = false;
};

}  // namespace diorama
