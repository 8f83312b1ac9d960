// SPDX-License-Identifier: Apache-2.0
#include "writer_yolo/polygon_parts.h"

#include <algorithm>
#include <numeric>

#include "opencv_support/mask_parts.h"
#include "reader_support/object_masks.h"

namespace diorama {

void PolygonParts::claim(std::size_t pixel, int part) {
  if (first_owner_[pixel] == 0) {
    first_owner_[pixel] = part;
    return;
  }
  ++shared_[{first_owner_[pixel], part}];
  const auto [first, last] = other_owners_.equal_range(pixel);
  for (auto other = first; other != last; ++other) ++shared_[{other->second, part}];
  other_owners_.emplace(pixel, part);
}

void PolygonParts::add(const CoverageMask& mask) {
  const MaskParts parts = connected_parts(mask.bits, mask.box.width(), mask.box.height());
  const int before = int(part_sizes_.size()) - 1;
  part_sizes_.insert(part_sizes_.end(), parts.sizes.begin(), parts.sizes.end());
  for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
    for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
      const std::int32_t part = parts.part[mask.index(x, y)];
      if (part != 0) claim(std::size_t(y) * std::size_t(width_) + std::size_t(x), before + part);
    }
  }
}

std::int64_t PolygonParts::contested() const {
  std::int64_t result = 0;
  for (const auto& [parts, count] : shared_) {
    const std::int64_t smaller =
        std::min(part_sizes_[std::size_t(parts.first)], part_sizes_[std::size_t(parts.second)]);
    if (count < smaller) result += count;
  }
  return result;
}

Image<std::uint32_t> ids_with_smaller_on_top(const std::vector<CoverageMask>& masks,
                                             const std::vector<std::uint32_t>& ids, int width,
                                             int height) {
  std::vector<std::size_t> order(masks.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::vector<std::int64_t> sizes;
  for (const CoverageMask& mask : masks) sizes.push_back(pixel_count(mask));
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return sizes[a] > sizes[b]; });
  Image<std::uint32_t> image(width, height, 0);
  for (const std::size_t i : order) {
    const CoverageMask& mask = masks[i];
    for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
      for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
        if (mask.bits[mask.index(x, y)] != 0) image.at(x, y) = ids[i];
      }
    }
  }
  return image;
}

}  // namespace diorama
