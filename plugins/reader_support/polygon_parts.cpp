// SPDX-License-Identifier: Apache-2.0
#include "reader_support/polygon_parts.h"

#include <algorithm>
#include <numeric>

#include "reader_support/object_masks.h"

namespace diorama {

std::vector<int> PolygonParts::number_parts(const CoverageMask& mask) {
  constexpr int kUnnumbered = -1;
  std::vector<int> parts(mask.bits.size());
  std::ranges::transform(mask.bits, parts.begin(),
                         [](std::uint8_t bit) { return bit != 0 ? kUnnumbered : 0; });
  const auto width = std::size_t(std::max(mask.box.width(), 1));
  std::vector<std::size_t> open;
  for (std::size_t start = 0; start < parts.size(); ++start) {
    if (parts[start] != kUnnumbered) continue;
    const auto part = int(part_sizes_.size());
    part_sizes_.push_back(0);
    const auto reach = [&](bool is_inside, std::size_t pixel) {
      if (!is_inside || parts[pixel] != kUnnumbered) return;
      parts[pixel] = part;
      open.push_back(pixel);
    };
    reach(true, start);
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      ++part_sizes_.back();
      reach(at % width > 0, at - 1);
      reach(at % width + 1 < width, at + 1);
      reach(at >= width, at - width);
      reach(at + width < parts.size(), at + width);
    }
  }
  return parts;
}

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
  const std::vector<int> parts = number_parts(mask);
  const auto width = std::size_t(std::max(mask.box.width(), 1));
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i] == 0) continue;
    const std::size_t x = std::size_t(mask.box.x_min) + i % width;
    const std::size_t y = std::size_t(mask.box.y_min) + i / width;
    claim(y * std::size_t(width_) + x, parts[i]);
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
