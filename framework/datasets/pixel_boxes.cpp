// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/pixel_boxes.h"

#include <algorithm>

namespace diorama {

std::map<std::uint32_t, PixelExtent> pixel_extents(const Image<std::uint32_t>& ids) {
  std::map<std::uint32_t, PixelExtent> seen;
  for (int y = 0; y < ids.height(); ++y) {
    for (int x = 0; x < ids.width(); ++x) {
      PixelExtent& each = seen[ids.at(x, y)];
      PixelBox& box = each.box;
      box = {std::min(box.x_min, x), std::min(box.y_min, y), std::max(box.x_max, x + 1),
             std::max(box.y_max, y + 1)};
      ++each.pixels;
    }
  }
  seen.erase(0);
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
