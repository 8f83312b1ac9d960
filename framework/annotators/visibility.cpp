// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/visibility.h"

#include <algorithm>
#include <limits>
#include <map>
#include <span>

namespace diorama {
namespace {

/// How many of a mask's bytes, which are 0 or 1, are set.
std::int64_t count_set(std::span<const std::uint8_t> bits) {
  // Parts whose sums fit into a byte, which compilers make vectors of.
  constexpr std::size_t kPart = 240;
  std::int64_t count = 0;
  std::size_t i = 0;
  for (; i + kPart <= bits.size(); i += kPart) {
    std::uint8_t part = 0;
    for (std::size_t k = 0; k < kPart; ++k) part = std::uint8_t(part + bits[i + k]);
    count += part;
  }
  for (; i < bits.size(); ++i) count += bits[i];
  return count;
}

constexpr int kFar = std::numeric_limits<int>::max();

/// Widens a box by the set bytes of a row that begins at (x, y). Looks only at what lies outside
/// the box's columns, so that few bytes are looked at twice.
void widen(PixelBox& box, int x, int y, std::span<const std::uint8_t> row) {
  const auto is_set = [](std::uint8_t bit) { return bit != 0; };
  const auto behind = [&](int edge) {
    return std::min(row.size(), std::size_t(std::max<std::int64_t>(edge, x) - x));
  };
  const auto left = row.first(behind(box.x_min));
  const auto first = std::ranges::find_if(left, is_set);
  if (first != left.end()) box.x_min = x + int(first - left.begin());
  const auto right = row.subspan(behind(box.x_max));
  const auto last = std::find_if(right.rbegin(), right.rend(), is_set);
  if (last != right.rend()) box.x_max = x + int(row.size()) - int(last - right.rbegin());
  box.y_min = std::min(box.y_min, y);
  box.y_max = y + 1;
}

/// Counts inside and outside, and the boxes of what lies inside and of all. Row by row, because
/// bits are counted many at once.
Visibility measure(const CoverageMask& mask, int image_width, int image_height) {
  Visibility visibility;
  const PixelBox& box = mask.box;
  const PixelBox in_image = box.clipped(image_width, image_height);
  PixelBox inside{kFar, kFar, std::numeric_limits<int>::min(), 0};
  PixelBox whole = inside;
  for (int y = box.y_min; y < box.y_max; ++y) {
    const auto row =
        std::span(mask.bits).subspan(mask.index(box.x_min, y), std::size_t(box.width()));
    const std::int64_t count = count_set(row);
    if (count == 0) continue;
    visibility.outside_pixels += count;
    widen(whole, box.x_min, y, row);
    if (y < in_image.y_min || y >= in_image.y_max || in_image.is_empty()) continue;
    const auto seen =
        row.subspan(std::size_t(in_image.x_min - box.x_min), std::size_t(in_image.width()));
    const std::int64_t seen_count = count_set(seen);
    if (seen_count == 0) continue;
    visibility.outside_pixels -= seen_count;
    visibility.amodal_pixels += seen_count;
    widen(inside, in_image.x_min, y, seen);
  }
  if (visibility.amodal_pixels > 0) visibility.amodal_box = inside;
  if (!whole.is_empty()) visibility.whole_box = whole;
  return visibility;
}

void check_mask(const CoverageMask& mask, const Instance& instance, const Frame& frame) {
  const PixelBox& box = mask.box;
  const std::size_t size =
      box.is_empty() ? 0 : std::size_t(box.width()) * std::size_t(box.height());
  if (mask.bits.size() == size) return;
  throw Error(ErrorKind::Internal, frame.camera_path + ": the coverage mask of " +
                                       instance.node_path + " holds " +
                                       std::to_string(mask.bits.size()) +
                                       " values, its box has room for " + std::to_string(size));
}

}  // namespace

std::map<std::uint32_t, std::int64_t> count_pixels(const Image<std::uint32_t>& ids) {
  std::map<std::uint32_t, std::int64_t> counts;
  // Neighbours are mostly equal: look up once per run.
  std::uint32_t run_id = 0;
  std::int64_t run_length = 0;
  for (const std::uint32_t id : ids.pixels()) {
    if (id != run_id) {
      if (run_length > 0) counts[run_id] += run_length;
      run_id = id;
      run_length = 0;
    }
    ++run_length;
  }
  if (run_length > 0) counts[run_id] += run_length;
  return counts;
}

void check_coverage(std::span<const CoverageMask> coverage, const Frame& frame) {
  if (coverage.size() != frame.instances.size()) {
    throw Error(ErrorKind::Internal, frame.camera_path + ": " + std::to_string(coverage.size()) +
                                         " coverage masks for " +
                                         std::to_string(frame.instances.size()) + " instances");
  }
  for (std::size_t i = 0; i < coverage.size(); ++i) {
    check_mask(coverage[i], frame.instances[i], frame);
  }
}

CoverageMask inside_image(CoverageMask mask, const Camera& camera) {
  const PixelBox inside = mask.box.clipped(camera.width, camera.height);
  if (inside == mask.box) return mask;
  return mask.cropped(inside);
}

VisibilityMeter::VisibilityMeter(bool keep_masks, Frame& frame)
    : keep_masks_(keep_masks),
      frame_(frame),
      visible_pixels_(count_pixels(frame.get(kInstanceId))) {}

void VisibilityMeter::add(std::span<const CoverageMask> coverage) {
  const auto& ids = frame_.get(kInstanceId);
  for (const CoverageMask& mask : coverage) {
    if (next_ == frame_.instances.size()) {
      throw Error(ErrorKind::Internal, frame_.camera_path + ": more coverage masks than the " +
                                           std::to_string(next_) + " instances");
    }
    Instance& instance = frame_.instances[next_++];
    check_mask(mask, instance, frame_);
    Visibility visibility = measure(mask, ids.width(), ids.height());
    const auto count = visible_pixels_.find(instance.id);
    if (count != visible_pixels_.end()) visibility.visible_pixels = count->second;
    if (keep_masks_ && visibility.amodal_box) {
      visibility.amodal_mask = mask.cropped(*visibility.amodal_box);
      visibility.amodal_mask.distances = {};
    }
    instance.visibility = std::move(visibility);
  }
}

void measure_visibility(std::span<const CoverageMask> coverage, bool keep_masks, Frame& frame) {
  check_coverage(coverage, frame);
  VisibilityMeter(keep_masks, frame).add(coverage);
}

}  // namespace diorama
