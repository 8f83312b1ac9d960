// SPDX-License-Identifier: Apache-2.0
#include "silhouette.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace diorama {
namespace {

// Far below all pixels: conversions to int round towards it, the library's floor() is a call.
constexpr int kShift = 1 << 20;
/// The largest whole number not above the value, within [from, to].
int floor_within(double value, int from, int to) {
  return int(std::clamp(value, double(from), double(to)) + kShift) - kShift;
}
int ceil_within(double value, int from, int to) { return -floor_within(-value, -to, -from); }

template <class Numbers>
Numbers larger(const Numbers& a, const Numbers& b) {
  return a > b ? a : b;
}
template <class Numbers>
Numbers smaller(const Numbers& a, const Numbers& b) {
  return a < b ? a : b;
}

}  // namespace

Silhouette::Silhouette(const Camera& camera, const PixelBox& box, bool with_distances, Isa isa)
    : camera_(camera),
      per_focal_length_(1.0 / camera.fx, 1.0 / camera.fy),
      box_(box),
      has_distances_(with_distances),
      has_avx2_(isa == Isa::Avx2 || isa == Isa::Avx512),
      bits_(std::size_t(box.width()) * std::size_t(box.height()), 0) {
  if (with_distances) nearness_.assign(bits_.size(), 0.0f);
}

void Silhouette::add(const Mesh& mesh, const Eigen::Matrix3f& linear, const Vec3f& translation,
                     const Affine& camera_from_world) {
  corners_.resize(mesh.positions.size());
  reaches_.resize(mesh.positions.size());
  const Placed placed{mesh.positions, linear, translation};
  if (has_avx2_) {
    place_avx2(placed, camera_from_world);
    add_all_avx2(mesh.triangles);
  } else {
    place(placed, camera_from_world);
    add_all(mesh.triangles);
  }
}

// Without fused multiplications, which would move edges by a hair.
[[gnu::target("avx2"), gnu::flatten]] void Silhouette::place_avx2(const Placed& mesh,
                                                                  const Affine& camera_from_world) {
  place(mesh, camera_from_world);
}
[[gnu::target("avx2"), gnu::flatten]] void Silhouette::add_all_avx2(
    const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  add_all(triangles);
}

inline void Silhouette::place(const Placed& mesh, const Affine& camera_from_world) {
  const Mat3 linear = camera_from_world.linear();
  const Vec3 translation = camera_from_world.translation();
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    Corner& corner = corners_[i];
    const Vec3f in_world = mesh.linear * mesh.positions[i] + mesh.translation;
    corner.position = linear * in_world.cast<double>() + translation;
    reaches_[i] = reach_of(corner);
  }
}

/// Pixels whose centres may lie between this corner and others are between their reaches.
inline Silhouette::FourInts Silhouette::reach_of(const Corner& corner) const {
  if (corner.depth() <= 0.0) return FourInts{-box_.x_min, -box_.y_min, box_.x_max, box_.y_max};
  constexpr double kRounding = 1e-6;
  const double per_depth = 1.0 / corner.depth();
  const double x = camera_.cx + camera_.fx * corner.position.x() * per_depth;
  const double y = camera_.cy - camera_.fy * corner.position.y() * per_depth;
  const Four sides{-(x - 0.5 - kRounding), -(y - 0.5 - kRounding), x + 0.5 + kRounding,
                   y + 0.5 + kRounding};
  const Four from{double(-box_.x_max), double(-box_.y_max), double(box_.x_min), double(box_.y_min)};
  const Four to{double(-box_.x_min), double(-box_.y_min), double(box_.x_max), double(box_.y_max)};
  const Four inside = larger(from, smaller(sides, to)) + double(kShift);
  return __builtin_convertvector(inside, FourInts) - kShift;
}

inline void Silhouette::add_all(const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  for (const auto& [a, b, c] : triangles) {
    const FourInts reach = larger(larger(reaches_[a], reaches_[b]), reaches_[c]);
    const PixelBox around{-reach[0], -reach[1], reach[2], reach[3]};
    if (!around.is_empty()) add_triangle(around, corners_[a], corners_[b], corners_[c]);
  }
}

/// Through the eye: what lies on the side of a plane that its normal points to.
template <class Number>
inline Silhouette::Lines<Number> Silhouette::lines_of(const Number& x, const Number& y,
                                                      const Number& z) const {
  Lines<Number> lines;
  lines.per_column = x * per_focal_length_.x();
  lines.per_row = -y * per_focal_length_.y();
  lines.at_origin = lines.per_column * (0.5 - camera_.cx) + lines.per_row * (0.5 - camera_.cy) - z;
  return lines;
}

/// Keeps the part of the span where no edge's value is negative.
inline void Silhouette::narrow(const Lines<Four>& edges, int row, Span& span) {
  const Four value = edges.per_row * double(row) + edges.at_origin;
  const Four zero = -value / edges.per_column;
  const Four none{};
  const Four from = edges.per_column > none ? zero : none + double(span.first);
  const Four to = edges.per_column < none ? zero : none + double(span.last);
  const double first = std::max(std::max(from[0], from[1]), from[2]);
  const double last = std::min(std::min(to[0], to[1]), to[2]);
  span = {ceil_within(first, span.first, span.last + 1),
          floor_within(last, span.first - 1, span.last)};
  const auto is_outside = (edges.per_column == none) & (value < none);
  if (is_outside[0] | is_outside[1] | is_outside[2]) span.last = span.first - 1;
}

inline void Silhouette::narrow(const Line& line, int row, Span& span) {
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
inline void Silhouette::add_triangle(const PixelBox& around, const Corner& a, const Corner& b,
                                     const Corner& c) {
  const double nearest = std::min({a.depth(), b.depth(), c.depth()});
  const double farthest = std::max({a.depth(), b.depth(), c.depth()});
  if (!(farthest >= camera_.near_m && nearest <= camera_.far_m)) return;
  const double volume = a.position.cross(b.position).dot(c.position);
  if (volume == 0.0 || !std::isfinite(volume)) return;  // seen edge-on, or no triangle
  // Normals of the planes through ab, bc and ca; the fourth is the first again.
  const Four x{a.position.x(), b.position.x(), c.position.x(), a.position.x()};
  const Four y{a.position.y(), b.position.y(), c.position.y(), a.position.y()};
  const Four z{a.position.z(), b.position.z(), c.position.z(), a.position.z()};
  const Four next_x = __builtin_shufflevector(x, x, 1, 2, 0, 1);
  const Four next_y = __builtin_shufflevector(y, y, 1, 2, 0, 1);
  const Four next_z = __builtin_shufflevector(z, z, 1, 2, 0, 1);
  const double side = volume < 0.0 ? -1.0 : 1.0;
  const Four normal_x = (y * next_z - z * next_y) * side;
  const Four normal_y = (z * next_x - x * next_z) * side;
  const Four normal_z = (x * next_y - y * next_x) * side;
  const Lines<Four> edges = lines_of(normal_x, normal_y, normal_z);

  const bool is_cut_near = nearest < camera_.near_m;
  const bool is_cut_far = farthest > camera_.far_m;
  Line nearness;  // 1 / depth, which is straight in the picture
  if (has_distances_ || is_cut_near || is_cut_far) {
    const auto sum = [&](const Four& n) { return (n[0] + n[1] + n[2]) / std::abs(volume); };
    nearness = lines_of(sum(normal_x), sum(normal_y), sum(normal_z));
  }
  std::array<Line, 2> cuts;
  std::size_t cut_count = 0;
  if (is_cut_near) {
    cuts[cut_count++] = {-nearness.per_column, -nearness.per_row,
                         1.0 / camera_.near_m - nearness.at_origin};
  }
  if (is_cut_far) {
    cuts[cut_count++] = {nearness.per_column, nearness.per_row,
                         nearness.at_origin - 1.0 / camera_.far_m};
  }
  for (int row = around.y_min; row < around.y_max; ++row) {
    Span span{around.x_min, around.x_max - 1};
    narrow(edges, row, span);
    for (std::size_t i = 0; i < cut_count && span.first <= span.last; ++i) {
      narrow(cuts[i], row, span);
    }
    if (span.first <= span.last) fill(row, span, nearness);
  }
}

inline void Silhouette::fill(int row, const Span& span, const Line& nearness) {
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
