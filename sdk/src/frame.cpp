// SPDX-License-Identifier: Apache-2.0
#include "diorama/frame.h"

#include <algorithm>
#include <span>

namespace diorama {

bool CoverageMask::covers(int x, int y) const {
  if (x < box.x_min || x >= box.x_max || y < box.y_min || y >= box.y_max) return false;
  return bits[index(x, y)] != 0;
}

PixelBox CoverageMask::extent() const {
  if (box.is_empty()) return {};
  PixelBox extent{box.x_max, box.y_max, box.x_min, box.y_min};
  for (int y = box.y_min; y < box.y_max; ++y) {
    // Large objects fill their rows: looking from both ends is soon over.
    const std::span row(&bits[index(box.x_min, y)], std::size_t(box.width()));
    const auto first = std::find_if(row.begin(), row.end(), [](auto bit) { return bit != 0; });
    if (first == row.end()) continue;
    const auto last = std::find_if(row.rbegin(), row.rend(), [](auto bit) { return bit != 0; });
    extent = {std::min(extent.x_min, box.x_min + int(first - row.begin())),
              std::min(extent.y_min, y),
              std::max(extent.x_max, box.x_max - int(last - row.rbegin())), y + 1};
  }
  return extent.is_empty() ? PixelBox() : extent;
}

CoverageMask CoverageMask::cropped(const PixelBox& part) const {
  CoverageMask mask;
  if (part.is_empty()) return mask;
  mask.box = part;
  const auto copy = [&](const auto& from, auto& to) {
    if (from.empty()) return;
    to.reserve(std::size_t(part.width()) * std::size_t(part.height()));
    for (int y = part.y_min; y < part.y_max; ++y) {
      const auto first = from.begin() + std::ptrdiff_t(index(part.x_min, y));
      to.insert(to.end(), first, first + part.width());
    }
  };
  copy(bits, mask.bits);
  copy(distances, mask.distances);
  return mask;
}

Frame::Frame() = default;
Frame::~Frame() = default;
Frame::Frame(Frame&&) noexcept = default;
Frame& Frame::operator=(Frame&&) noexcept = default;

bool Frame::has(std::string_view channel) const { return images_.contains(channel); }

NameSet Frame::channels() const {
  NameSet names;
  for (const auto& [name, image] : images_) names.insert(name);
  return names;
}

void Frame::set_image(std::string_view channel, AnyImage image) {
  images_.insert_or_assign(std::string(channel), std::move(image));
}

const AnyImage& Frame::image_named(std::string_view channel) const {
  const auto found = images_.find(channel);
  if (found != images_.end()) return found->second;
  std::string known;
  for (const auto& [name, image] : images_) known += (known.empty() ? "" : ", ") + name;
  throw Error(ErrorKind::Internal, camera_path + ": there is no channel '" + std::string(channel) +
                                       "'; there are: " + (known.empty() ? "none" : known));
}

}  // namespace diorama
