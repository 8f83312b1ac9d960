// SPDX-License-Identifier: Apache-2.0
#include "diorama/frame.h"

namespace diorama {

bool CoverageMask::covers(int x, int y) const {
  if (x < box.x_min || x >= box.x_max || y < box.y_min || y >= box.y_max) return false;
  const std::size_t row = std::size_t(y - box.y_min);
  return bits[row * std::size_t(box.width()) + std::size_t(x - box.x_min)] != 0;
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
