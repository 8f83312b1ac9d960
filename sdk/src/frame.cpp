// SPDX-License-Identifier: Apache-2.0
#include "diorama/frame.h"

#include <algorithm>
#include <cstring>
#include <iterator>

namespace diorama {
namespace {

/// get() throws when the pixel type differs from the one in frame.h.
template <class... Pixels>
void check_type(const Frame& frame, std::string_view name, const Channel<Pixels>&... channels) {
  ((name == channels.name ? void(frame.get(channels)) : void()), ...);
}

}  // namespace

bool is_annotation(std::string_view name) {
  return name == "instances" || name == "visibility" || name == "amodal_mask" ||
         name == "occlusion_order";
}

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

bool Frame::is_readable(std::string_view channel) const {
  return !access_ || access_->readable.contains(channel);
}

bool Frame::has(std::string_view channel) const {
  return is_readable(channel) && images_.contains(channel);
}

NameSet Frame::channels() const {
  NameSet names;
  for (const auto& [name, image] : images_) {
    if (is_readable(name)) names.insert(name);
  }
  return names;
}

void Frame::check_channel(std::string_view channel) const {
  const auto check_size = [&](const auto& image) {
    if (image.width() == camera.width && image.height() == camera.height) return;
    throw Error(ErrorKind::Internal, camera_path + ": channel '" + std::string(channel) + "' has " +
                                         std::to_string(image.width()) + " x " +
                                         std::to_string(image.height()) + " pixels, expected " +
                                         std::to_string(camera.width) + " x " +
                                         std::to_string(camera.height));
  };
  std::visit(check_size, image_named(channel));
  check_type(*this, channel, kColor, kColorHdr, kDistanceToCamera, kDistanceToImagePlane, kNormals,
             kLeafId, kInstanceId, kPosition, kUv, kAlbedo, kObjectCoordinates, kMotion,
             kSensorDepth, kFlowForward, kFlowBackward, kFlowForwardState, kFlowBackwardState);
}

void Frame::set_image(std::string_view channel, AnyImage image) {
  if (access_ && !access_->settable.contains(channel)) {
    throw Error(ErrorKind::Internal, camera_path + ": sets the channel '" + std::string(channel) +
                                         "', which is not among those that it says it provides");
  }
  images_.insert_or_assign(std::string(channel), std::move(image));
}

const AnyImage& Frame::image_named(std::string_view channel) const {
  const auto found = images_.find(channel);
  if (found != images_.end() && is_readable(channel)) return found->second;
  if (!is_readable(channel)) {
    throw Error(ErrorKind::Internal, camera_path + ": reads the channel '" + std::string(channel) +
                                         "', which is not among those that it says it needs");
  }
  std::string known;
  for (const std::string& name : channels()) known += (known.empty() ? "" : ", ") + name;
  throw Error(ErrorKind::Internal, camera_path + ": there is no channel '" + std::string(channel) +
                                       "'; there are: " + (known.empty() ? "none" : known));
}

}  // namespace diorama
