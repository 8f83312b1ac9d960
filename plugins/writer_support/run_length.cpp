// SPDX-License-Identifier: Apache-2.0
#include "writer_support/run_length.h"

namespace diorama {
namespace {

/// `is_set(x, y)` is asked inside `box` only.
template <class IsSet>
RunLength encode(int width, int height, const PixelBox& box, IsSet is_set) {
  RunLength result{width, height, {}};
  bool last = false;
  std::uint32_t run = 0;
  const auto add = [&](bool value, std::uint32_t count) {
    if (count == 0) return;
    if (value != last) {
      result.counts.push_back(run);
      last = value;
      run = 0;
    }
    run += count;
  };
  add(false, std::uint32_t(box.x_min) * std::uint32_t(height));
  for (int x = box.x_min; x < box.x_max; ++x) {
    add(false, std::uint32_t(box.y_min));
    for (int y = box.y_min; y < box.y_max; ++y) add(is_set(x, y), 1);
    add(false, std::uint32_t(height - box.y_max));
  }
  add(false, std::uint32_t(width - box.x_max) * std::uint32_t(height));
  result.counts.push_back(run);
  return result;
}

}  // namespace

RunLength run_length(const Image<std::uint32_t>& ids, std::uint32_t id, const PixelBox& box) {
  return encode(ids.width(), ids.height(), box, [&](int x, int y) { return ids.at(x, y) == id; });
}

RunLength run_length(const CoverageMask& mask, int image_width, int image_height) {
  return encode(image_width, image_height, mask.box,
                [&](int x, int y) { return mask.covers(x, y); });
}

Json coco_rle(const RunLength& mask) {
  std::string text;
  for (std::size_t i = 0; i < mask.counts.size(); ++i) {
    std::int64_t rest = mask.counts[i];
    if (i > 2) rest -= mask.counts[i - 2];
    bool more = true;
    while (more) {
      std::int64_t group = rest & 0x1F;
      rest >>= 5;
      more = (group & 0x10) != 0 ? rest != -1 : rest != 0;
      if (more) group |= 0x20;
      text += char(group + 48);
    }
  }
  return {{"size", {mask.height, mask.width}}, {"counts", text}};
}

}  // namespace diorama
