// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/polygon.h"

#include <cmath>
#include <numeric>

namespace diorama::loader_usd {
namespace {

// Above this, ears are not searched for: a fan keeps huge polygons from taking quadratic time.
constexpr std::size_t kMaxEarClipping = 4096;

double cross(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

// Newell's sum: right also for bent polygons.
Vec3 normal_of(std::span<const Vec3f> corners) {
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3 a = corners[i].cast<double>();
    const Vec3 b = corners[(i + 1) % corners.size()].cast<double>();
    normal += a.cross(b);
  }
  return normal;
}

std::vector<Vec2> project(std::span<const Vec3f> corners, const Vec3& normal) {
  Vec3 x = normal.cwiseAbs().x() < 0.9 ? Vec3::UnitX() : Vec3::UnitY();
  x = (x - x.dot(normal) * normal).normalized();
  const Vec3 y = normal.cross(x);
  std::vector<Vec2> flat;
  const Vec3 origin = corners[0].cast<double>();
  for (const Vec3f& corner : corners) {
    const Vec3 offset = corner.cast<double>() - origin;
    flat.emplace_back(offset.dot(x), offset.dot(y));
  }
  return flat;
}

// Whether the diagonal from the first to the third corner splits four corners into two triangles
// that face the same way, as it does in convex quads and so in nearly all.
bool is_split_by_first_diagonal(std::span<const Vec3f> quad) {
  const Vec3 origin = quad[0].cast<double>();
  const Vec3 b = quad[1].cast<double>() - origin;
  const Vec3 c = quad[2].cast<double>() - origin;
  const Vec3 d = quad[3].cast<double>() - origin;
  const Vec3 first = b.cross(c);
  const Vec3 second = c.cross(d);
  const Vec3 normal = first + second;
  return first.dot(normal) > 0.0 && second.dot(normal) > 0.0;
}

bool is_ear(const std::vector<Vec2>& flat, const std::vector<std::uint32_t>& ring, std::size_t at) {
  const std::size_t n = ring.size();
  const std::uint32_t before = ring[(at + n - 1) % n];
  const std::uint32_t here = ring[at];
  const std::uint32_t after = ring[(at + 1) % n];
  if (cross(flat[before], flat[here], flat[after]) <= 0.0) return false;
  for (const std::uint32_t other : ring) {
    if (other == before || other == here || other == after) continue;
    const Vec2& point = flat[other];
    // Corners at the same place touch, they do not block.
    if (point == flat[before] || point == flat[here] || point == flat[after]) continue;
    const bool is_inside = cross(flat[before], flat[here], point) >= 0.0 &&
                           cross(flat[here], flat[after], point) >= 0.0 &&
                           cross(flat[after], flat[before], point) >= 0.0;
    if (is_inside) return false;
  }
  return true;
}

}  // namespace

void triangulate(std::span<const Vec3f> corners,
                 std::vector<std::array<std::uint32_t, 3>>& triangles) {
  const auto n = static_cast<std::uint32_t>(corners.size());
  if (n < 3) return;
  if (n == 3) {
    triangles.push_back({0, 1, 2});
    return;
  }
  if (n == 4 && is_split_by_first_diagonal(corners)) {
    triangles.insert(triangles.end(), {{0, 1, 2}, {0, 2, 3}});
    return;
  }
  const Vec3 normal = normal_of(corners);
  const double area = normal.norm();
  if (!(area > 0.0) || !std::isfinite(area) || n > kMaxEarClipping) {
    for (std::uint32_t i = 1; i + 1 < n; ++i) triangles.push_back({0, i, i + 1});
    return;
  }
  const std::vector<Vec2> flat = project(corners, normal / area);
  std::vector<std::uint32_t> ring(n);
  std::iota(ring.begin(), ring.end(), 0u);
  std::size_t at = 1;
  for (std::size_t tries = 0; ring.size() > 3;) {
    // A polygon that crosses itself has no ears left at some point: then any corner will do.
    const bool clips = is_ear(flat, ring, at % ring.size()) || tries > ring.size();
    if (!clips) {
      ++at;
      ++tries;
      continue;
    }
    const std::size_t k = at % ring.size();
    triangles.push_back(
        {ring[(k + ring.size() - 1) % ring.size()], ring[k], ring[(k + 1) % ring.size()]});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(k));
    tries = 0;
    at = k;
  }
  triangles.push_back({ring[0], ring[1], ring[2]});
}

}  // namespace diorama::loader_usd
