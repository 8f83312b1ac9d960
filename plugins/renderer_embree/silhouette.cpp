// SPDX-License-Identifier: Apache-2.0
#include "silhouette.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace diorama {
namespace {

// Far below all pixels: conversions to int round towards it, the library's floor() is a call.
constexpr double kShift = 1 << 20;
/// The largest whole number not above the value, within [from, to].
int floor_within(double value, int from, int to) {
  return int(std::clamp(value, double(from), double(to)) + kShift) - int(kShift);
}
int ceil_within(double value, int from, int to) { return -floor_within(-value, -to, -from); }

}  // namespace

Silhouette::Silhouette(const Camera& camera, const PixelBox& box, bool with_distances)
    : camera_(camera),
      per_focal_length_(1.0 / camera.fx, 1.0 / camera.fy),
      box_(box),
      has_distances_(with_distances),
      bits_(std::size_t(box.width()) * std::size_t(box.height()), 0) {
  if (with_distances) nearness_.assign(bits_.size(), 0.0f);
}

void Silhouette::add(const std::vector<std::array<std::uint32_t, 3>>& triangles,
                     const std::vector<float>& positions, std::size_t vertex_count,
                     const Affine& camera_from_world) {
  const Mat3 linear = camera_from_world.linear();
  const Vec3 translation = camera_from_world.translation();
  corners_.resize(vertex_count);
  for (std::size_t i = 0; i < vertex_count; ++i) {
    Corner& corner = corners_[i];
    corner.position =
        linear * Eigen::Map<const Vec3f>(&positions[3 * i]).cast<double>() + translation;
    const double per_depth = 1.0 / corner.depth();
    corner.pixel = {camera_.cx + camera_.fx * corner.position.x() * per_depth,
                    camera_.cy - camera_.fy * corner.position.y() * per_depth};
  }
  for (const auto& t : triangles) add_triangle(corners_[t[0]], corners_[t[1]], corners_[t[2]]);
}

/// Those whose centres may lie in the triangle.
PixelBox Silhouette::pixels_around(const Corner& a, const Corner& b, const Corner& c) const {
  if (std::min({a.depth(), b.depth(), c.depth()}) <= 0.0) return box_;
  constexpr double kRounding = 1e-6;
  const Vec2 low = a.pixel.cwiseMin(b.pixel).cwiseMin(c.pixel);
  const Vec2 high = a.pixel.cwiseMax(b.pixel).cwiseMax(c.pixel);
  return {ceil_within(low.x() - 0.5 - kRounding, box_.x_min, box_.x_max),
          ceil_within(low.y() - 0.5 - kRounding, box_.y_min, box_.y_max),
          floor_within(high.x() + 0.5 + kRounding, box_.x_min, box_.x_max),
          floor_within(high.y() + 0.5 + kRounding, box_.y_min, box_.y_max)};
}

/// Through the eye: what lies on the side of the plane that `normal` points to.
Silhouette::Line Silhouette::line_of(const Vec3& normal) const {
  Line line;
  line.per_column = normal.x() * per_focal_length_.x();
  line.per_row = -normal.y() * per_focal_length_.y();
  line.at_origin =
      line.per_column * (0.5 - camera_.cx) + line.per_row * (0.5 - camera_.cy) - normal.z();
  return line;
}

/// Keeps the part of the span where the line's value is not negative.
void Silhouette::narrow(const Line& line, int row, Span& span) {
  const double value = line.per_row * row + line.at_origin;
  if (line.per_column == 0.0) {
    if (value < 0.0) span.last = span.first - 1;
    return;
  }
  const double zero = -value / line.per_column;
  if (line.per_column > 0.0) {
    span.first = ceil_within(zero, span.first, span.last + 1);
  } else {
    span.last = floor_within(zero, span.first - 1, span.last);
  }
}

// The planes through the eye and two corners bound what the triangle covers, also when some of its
// corners lie behind the camera. An edge gives its two triangles the same plane with opposite signs
// to the last bit, so that a centre on it belongs to both.
void Silhouette::add_triangle(const Corner& a, const Corner& b, const Corner& c) {
  const double nearest = std::min({a.depth(), b.depth(), c.depth()});
  const double farthest = std::max({a.depth(), b.depth(), c.depth()});
  if (!(farthest >= camera_.near_m && nearest <= camera_.far_m)) return;
  const PixelBox around = pixels_around(a, b, c);
  if (around.is_empty()) return;
  Vec3 ab = a.position.cross(b.position);
  Vec3 bc = b.position.cross(c.position);
  Vec3 ca = c.position.cross(a.position);
  double volume = ab.dot(c.position);
  if (volume == 0.0 || !std::isfinite(volume)) return;  // seen edge-on, or no triangle
  if (volume < 0.0) {
    ab = -ab;
    bc = -bc;
    ca = -ca;
    volume = -volume;
  }
  const bool is_cut_near = nearest < camera_.near_m;
  const bool is_cut_far = farthest > camera_.far_m;
  Line nearness;  // 1 / depth, which is straight in the picture
  if (has_distances_ || is_cut_near || is_cut_far) nearness = line_of((ab + bc + ca) / volume);
  std::array<Line, 5> lines{line_of(ab), line_of(bc), line_of(ca)};
  std::size_t count = 3;
  if (is_cut_near) {
    lines[count++] = {-nearness.per_column, -nearness.per_row,
                      1.0 / camera_.near_m - nearness.at_origin};
  }
  if (is_cut_far) {
    lines[count++] = {nearness.per_column, nearness.per_row,
                      nearness.at_origin - 1.0 / camera_.far_m};
  }
  for (int row = around.y_min; row < around.y_max; ++row) {
    Span span{around.x_min, around.x_max - 1};
    for (std::size_t i = 0; i < count && span.first <= span.last; ++i) narrow(lines[i], row, span);
    if (span.first <= span.last) fill(row, span, nearness);
  }
}

void Silhouette::fill(int row, const Span& span, const Line& nearness) {
  const std::size_t begin = std::size_t(row - box_.y_min) * std::size_t(box_.width()) +
                            std::size_t(span.first - box_.x_min);
  const auto count = std::size_t(span.last - span.first + 1);
  std::fill_n(bits_.begin() + std::ptrdiff_t(begin), count, std::uint8_t(1));
  if (!has_distances_) return;
  const double at_first =
      nearness.per_row * row + nearness.at_origin + nearness.per_column * span.first;
  for (std::size_t i = 0; i < count; ++i) {
    const auto here = float(at_first + nearness.per_column * double(i));
    nearness_[begin + i] = std::max(nearness_[begin + i], here);
  }
}

CoverageMask Silhouette::take() {
  CoverageMask mask;
  mask.box = box_;
  mask.bits = std::move(bits_);
  mask.distances = std::move(nearness_);
  if (!has_distances_) return mask;
  std::size_t i = 0;
  for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
    const double down = (y + 0.5 - camera_.cy) / camera_.fy;
    for (int x = mask.box.x_min; x < mask.box.x_max; ++x, ++i) {
      const double right = (x + 0.5 - camera_.cx) / camera_.fx;
      const double slant = std::sqrt(1.0 + right * right + down * down);
      mask.distances[i] = float(slant / double(mask.distances[i]));  // infinite where nothing is
    }
  }
  return mask;
}

}  // namespace diorama
