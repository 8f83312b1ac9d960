// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/label_polygons.h"

#include <algorithm>
#include <cmath>

namespace diorama::lint {

PolygonMasks::Mask PolygonMasks::mask_of(const std::vector<Vec2>& polygon) const {
  Eigen::AlignedBox2d extent;
  for (const Vec2& point : polygon) extent.extend(point);
  const auto within = [](double value, int size) {
    return int(std::clamp(value, 0.0, double(size)));
  };
  Mask mask;
  if (extent.isEmpty()) return mask;
  mask.x = within(std::floor(extent.min().x()), width_);
  mask.y = within(std::floor(extent.min().y()), height_);
  mask.width = within(std::ceil(extent.max().x()), width_) - mask.x;
  mask.height = within(std::ceil(extent.max().y()), height_) - mask.y;
  mask.values.assign(std::size_t(mask.width) * std::size_t(mask.height), 0);
  std::vector<double> crossings;
  for (int row = 0; row < mask.height; ++row) {
    const double line = mask.y + row + 0.5;
    crossings.clear();
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vec2& a = polygon[i];
      const Vec2& b = polygon[(i + 1) % polygon.size()];
      if ((a.y() <= line) == (b.y() <= line)) continue;
      crossings.push_back(a.x() + (line - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
    }
    std::ranges::sort(crossings);
    const auto first = mask.values.begin() + std::ptrdiff_t(row) * mask.width;
    for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
      const int from = within(std::ceil(crossings[i] - 0.5) - mask.x, mask.width);
      const int to = within(std::ceil(crossings[i + 1] - 0.5) - mask.x, mask.width);
      if (from < to) std::fill(first + from, first + to, 1);
    }
  }
  return mask;
}

void PolygonMasks::number_parts(Mask& mask) {
  constexpr int kUnnumbered = -1;
  for (int& value : mask.values) value = value != 0 ? kUnnumbered : 0;
  const auto width = std::size_t(mask.width);
  std::vector<std::size_t> open;
  for (std::size_t start = 0; start < mask.values.size(); ++start) {
    if (mask.values[start] != kUnnumbered) continue;
    const auto part = int(part_sizes_.size());
    part_sizes_.push_back(0);
    const auto reach = [&](bool is_inside, std::size_t pixel) {
      if (!is_inside || mask.values[pixel] != kUnnumbered) return;
      mask.values[pixel] = part;
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
      reach(at + width < mask.values.size(), at + width);
    }
  }
}

void PolygonMasks::claim(std::size_t pixel, int part) {
  if (first_owner_[pixel] == 0) {
    first_owner_[pixel] = part;
    return;
  }
  ++shared_[{first_owner_[pixel], part}];
  const auto [first, last] = other_owners_.equal_range(pixel);
  for (auto other = first; other != last; ++other) ++shared_[{other->second, part}];
  other_owners_.emplace(pixel, part);
}

int PolygonMasks::add(const std::vector<Vec2>& polygon) {
  Mask mask = mask_of(polygon);
  number_parts(mask);
  int covered = 0;
  for (std::size_t i = 0; i < mask.values.size(); ++i) {
    if (mask.values[i] == 0) continue;
    const std::size_t x = std::size_t(mask.x) + i % std::size_t(mask.width);
    const std::size_t y = std::size_t(mask.y) + i / std::size_t(mask.width);
    claim(y * std::size_t(width_) + x, mask.values[i]);
    ++covered;
  }
  return covered;
}

int PolygonMasks::contested() const {
  int result = 0;
  for (const auto& [parts, count] : shared_) {
    const int smaller =
        std::min(part_sizes_[std::size_t(parts.first)], part_sizes_[std::size_t(parts.second)]);
    if (count < smaller) result += count;
  }
  return result;
}

}  // namespace diorama::lint
