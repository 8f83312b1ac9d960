// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/pixel_boxes.h"

#include <algorithm>

namespace diorama {

std::map<std::uint32_t, PixelExtent> pixel_extents(const Image<std::uint32_t>& ids) {
  std::map<std::uint32_t, PixelExtent> seen;
  for (int y = 0; y < ids.height(); ++y) {
    const auto row = ids.row(y);
    for (int x = 0, end = 0; x < ids.width(); x = end) {
      const std::uint32_t id = row[std::size_t(x)];
      while (end < ids.width() && row[std::size_t(end)] == id) ++end;
      if (id == 0) continue;
      PixelExtent& each = seen[id];
      PixelBox& box = each.box;
      box = {std::min(box.x_min, x), std::min(box.y_min, y), std::max(box.x_max, end),
             std::max(box.y_max, y + 1)};
      each.pixels += end - x;
    }
  }
  return seen;
}

void complete_boxes(Frame& frame) {
  const bool has_all = std::ranges::all_of(
      frame.instances, [](const Instance& instance) { return instance.tight_box.has_value(); });
  if (has_all || !frame.has(kInstanceId.name)) return;
  const auto seen = pixel_extents(frame.get(kInstanceId));
  for (Instance& instance : frame.instances) {
    const auto found = seen.find(instance.id);
    if (!instance.tight_box && found != seen.end()) instance.tight_box = found->second.box;
  }
}

}  // namespace diorama
