// SPDX-License-Identifier: Apache-2.0
#include "diorama/frame.h"

#include <algorithm>
#include <cstring>
#include <iterator>

namespace diorama {

bool CoverageMask::covers(int x, int y) const {
  if (x < box.x_min || x >= box.x_max || y < box.y_min || y >= box.y_max) return false;
  return bits[index(x, y)] != 0;
}

PixelBox CoverageMask::extent() const {
  if (box.is_empty()) return {};
  const auto width = std::size_t(box.width());
  PixelBox extent{box.x_max, box.y_max, box.x_min, box.y_min};
  for (int y = box.y_min; y < box.y_max; ++y) {
    // Looking from both ends is soon over where large objects fill their rows, and the library's
    // search is quick where nothing does.
    const std::uint8_t* row = &bits[index(box.x_min, y)];
    const auto* first = static_cast<const std::uint8_t*>(std::memchr(row, 1, width));
    if (!first) continue;
    const std::reverse_iterator end(row + width);
    const auto behind_last = std::find(end, std::reverse_iterator(first), 1).base();
    extent = {std::min(extent.x_min, box.x_min + int(first - row)), std::min(extent.y_min, y),
              std::max(extent.x_max, box.x_min + int(behind_last - row)), y + 1};
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
