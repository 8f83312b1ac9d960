// SPDX-License-Identifier: Apache-2.0
#include "reader_support/object_masks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace diorama {
namespace {

/// Differences to the one before the previous, in groups of five bits.
std::vector<std::int64_t> decoded_counts(const std::string& text) {
  std::vector<std::int64_t> runs;
  for (std::size_t at = 0; at < text.size();) {
    std::uint64_t value = 0;
    int shift = 0;
    int group = 0x20;
    while ((group & 0x20) != 0) {
      if (at >= text.size()) throw std::runtime_error("run lengths are cut short");
      group = text[at++] - 48;
      if (group < 0 || group > 0x3F || shift > 40) {
        throw std::runtime_error("run lengths hold a character that means nothing");
      }
      value |= std::uint64_t(group & 0x1F) << shift;
      shift += 5;
    }
    if ((group & 0x10) != 0) value |= ~std::uint64_t(0) << shift;
    auto run = std::int64_t(value);
    if (runs.size() > 2) run += runs[runs.size() - 2];
    if (run < 0 || run > kMostPixels) throw std::runtime_error("run lengths exceed the image");
    runs.push_back(run);
  }
  return runs;
}

CoverageMask empty_mask(const PixelBox& box) {
  CoverageMask mask;
  if (box.is_empty()) return mask;
  mask.box = box;
  mask.bits.assign(std::size_t(box.width()) * std::size_t(box.height()), 0);
  return mask;
}

/// Calls visit(first, count) for every run of ones, in pixels down the columns.
template <class Visit>
void visit_runs(const std::vector<std::int64_t>& runs, std::int64_t size, Visit&& visit) {
  std::int64_t at = 0;
  bool is_set = false;
  for (const std::int64_t run : runs) {
    if (run < 0 || run > size - at) throw std::runtime_error("run lengths exceed the image");
    if (is_set && run > 0) visit(at, run);
    at += run;
    is_set = !is_set;
  }
  if (at != size) throw std::runtime_error("run lengths do not fill the image");
}

std::vector<std::int64_t> run_list(const Json& counts) {
  std::vector<std::int64_t> runs;
  for (const Json& count : counts) runs.push_back(whole_number<std::int64_t>(count));
  return runs;
}

}  // namespace

CoverageMask mask_of_run_lengths(const Json& rle, int width, int height) {
  if (whole_number<std::int64_t>(rle.at("size").at(0)) != height ||
      whole_number<std::int64_t>(rle.at("size").at(1)) != width) {
    throw std::runtime_error("mask and image differ in size");
  }
  const Json& counts = rle.at("counts");
  const auto runs =
      counts.is_array() ? run_list(counts) : decoded_counts(counts.get<std::string>());
  const std::int64_t size = std::int64_t(width) * height;
  PixelBox box{width, height, 0, 0};
  visit_runs(runs, size, [&](std::int64_t first, std::int64_t count) {
    const std::int64_t last = first + count - 1;
    const int x0 = int(first / height);
    const int x1 = int(last / height);
    box.x_min = std::min(box.x_min, x0);
    box.x_max = std::max(box.x_max, x1 + 1);
    box.y_min = std::min(box.y_min, x0 == x1 ? int(first % height) : 0);
    box.y_max = std::max(box.y_max, (x0 == x1 ? int(last % height) : height - 1) + 1);
  });
  CoverageMask mask = empty_mask(box);
  visit_runs(runs, size, [&](std::int64_t first, std::int64_t count) {
    for (std::int64_t at = first; at < first + count; ++at) {
      mask.bits[mask.index(int(at / height), int(at % height))] = 1;
    }
  });
  return mask;
}

CoverageMask mask_of_polygons(const std::vector<std::vector<Vec2>>& polygons, int width,
                              int height) {
  Eigen::AlignedBox2d extent;
  for (const auto& polygon : polygons) {
    for (const Vec2& point : polygon) extent.extend(point);
  }
  if (extent.isEmpty()) return {};
  const auto within = [](double value, int size) {
    return int(std::clamp(value, 0.0, double(size)));
  };
  CoverageMask mask = empty_mask(
      {within(std::floor(extent.min().x()), width), within(std::floor(extent.min().y()), height),
       within(std::ceil(extent.max().x()), width), within(std::ceil(extent.max().y()), height)});
  std::vector<double> crossings;
  for (const auto& polygon : polygons) {
    for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
      const double line = y + 0.5;
      crossings.clear();
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vec2& a = polygon[i];
        const Vec2& b = polygon[(i + 1) % polygon.size()];
        if ((a.y() <= line) == (b.y() <= line)) continue;
        crossings.push_back(a.x() + (line - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
      }
      std::ranges::sort(crossings);
      for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
        const int from = std::max(within(std::ceil(crossings[i] - 0.5), width), mask.box.x_min);
        const int to = std::min(within(std::ceil(crossings[i + 1] - 0.5), width), mask.box.x_max);
        for (int x = from; x < to; ++x) mask.bits[mask.index(x, y)] = 1;
      }
    }
  }
  return mask;
}

std::int64_t pixel_count(const CoverageMask& mask) {
  return std::ranges::count(mask.bits, std::uint8_t(1));
}

std::int64_t shared_pixels(const CoverageMask& a, const CoverageMask& b) {
  const PixelBox common{std::max(a.box.x_min, b.box.x_min), std::max(a.box.y_min, b.box.y_min),
                        std::min(a.box.x_max, b.box.x_max), std::min(a.box.y_max, b.box.y_max)};
  std::int64_t count = 0;
  for (int y = common.y_min; y < common.y_max; ++y) {
    for (int x = common.x_min; x < common.x_max; ++x) {
      if (a.bits[a.index(x, y)] != 0 && b.bits[b.index(x, y)] != 0) ++count;
    }
  }
  return count;
}

std::int64_t InstancePainter::paint(const CoverageMask& mask, std::uint32_t id) {
  std::int64_t taken = 0;
  for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
    for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
      if (mask.bits[mask.index(x, y)] == 0) continue;
      std::uint32_t& pixel = ids_.at(x, y);
      if (pixel != 0) {
        ++taken;
      } else {
        pixel = id;
      }
    }
  }
  has_overlaps_ = has_overlaps_ || taken > 0;
  return taken;
}

}  // namespace diorama
