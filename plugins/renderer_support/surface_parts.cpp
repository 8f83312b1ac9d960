// SPDX-License-Identifier: Apache-2.0
#include "surface_parts.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace diorama {
namespace {

struct Corners {
  Vec3f a, ab, ac;

  Corners(const MeshInstance& instance, std::uint32_t triangle) {
    const auto [first, second, third] = instance.shading->corners(triangle);
    a = instance.vertex(first);
    ab = instance.vertex(second) - a;
    ac = instance.vertex(third) - a;
  }
  double area() const { return 0.5 * double(ab.cross(ac).norm()); }
};

constexpr double kMostRows = 1024.0;
constexpr double kMostOwn = 128.0;  // parts for each mesh, whatever its area

}  // namespace

SurfaceParts::SurfaceParts(std::span<const MeshInstance> instances, std::size_t wanted)
    : instances_(instances) {
  std::vector<double> areas;
  double all = 0.0;
  for (const MeshInstance& instance : instances) {
    double area = 0.0;
    for (std::uint32_t t = 0; t < instance.shading->number_end(); ++t) {
      if (!instance.shading->is_repeated(t)) area += Corners(instance, t).area();
    }
    areas.push_back(area);
    all += area;
  }
  // Half of them by area. The other half for every mesh alike: a lamp is small, and no two sides of
  // its shade are lit alike.
  const double half = double(std::max<std::size_t>(2, wanted)) / 2.0;
  const double own =
      std::clamp(half / double(std::max<std::size_t>(1, areas.size())), 1.0, kMostOwn);
  for (std::uint32_t i = 0; i < areas.size(); ++i) cut(i, std::min(all / half, areas[i] / own));
}

void SurfaceParts::cut(std::uint32_t number, double most) {
  const MeshInstance& instance = instances_[number];
  starts_.push_back(std::uint32_t(triangles_.size()));
  bool is_open = false;  // the last part: triangles may be added
  for (std::uint32_t t = 0; t < instance.shading->number_end(); ++t) {
    if (instance.shading->is_repeated(t)) {
      triangles_.push_back(triangles_.back());
      continue;
    }
    const double area = Corners(instance, t).area();
    if (area > most) {
      const auto rows = std::uint32_t(std::min(kMostRows, std::ceil(std::sqrt(area / most))));
      triangles_.push_back({std::uint32_t(parts_.size()), rows, 0.0f});
      const std::uint32_t pieces = rows * rows;
      for (std::uint32_t k = 0; k < pieces; ++k) {
        parts_.push_back({area / pieces, number, t, 1, rows, k});
      }
      is_open = false;
      continue;
    }
    if (!is_open || parts_.back().area + area > most) parts_.push_back({0.0, number, t, 0, 0, 0});
    is_open = true;
    parts_.back().area += area;
    parts_.back().count = t + 1 - parts_.back().triangle;
    triangles_.push_back({std::uint32_t(parts_.size() - 1), 0, float(parts_.back().area)});
  }
}

// Row i has pieces of both kinds in turns: upright ones, and between them such that stand on their
// tip, one less.
std::uint32_t SurfaceParts::piece_at(float u, float v, std::uint32_t rows) {
  const float x = std::max(0.0f, u * float(rows));
  const float y = std::max(0.0f, v * float(rows));
  const std::uint32_t i = std::min(std::uint32_t(x), rows - 1);
  const std::uint32_t j = std::min(std::uint32_t(y), rows - 1 - i);
  const bool is_turned = (x - float(i)) + (y - float(j)) > 1.0f && i + j + 1 < rows;
  return i * (2 * rows - i) + 2 * j + (is_turned ? 1 : 0);
}

std::size_t SurfaceParts::part_of(std::uint32_t instance, std::uint32_t number, float u, float v,
                                  bool is_back) const {
  const Triangle& triangle = triangles_[starts_[instance] + number];
  std::size_t part = triangle.part;
  if (triangle.rows > 0) {
    // The second number of a triangle without a partner has its corners exchanged.
    if (parts_[part].triangle != number) std::swap(u, v);
    part += piece_at(u, v, triangle.rows);
  }
  return 2 * part + (is_back ? 1 : 0);
}

SurfaceParts::Point SurfaceParts::point(std::size_t side, float choice, const Vec2f& u) const {
  const Part& part = parts_[side / 2];
  const MeshInstance& instance = instances_[part.instance];
  Vec2f at = triangle_from_square(u);
  std::uint32_t triangle = part.triangle;
  if (part.rows > 0) {
    std::uint32_t row = 0;
    while ((row + 1) * (2 * part.rows - row - 1) <= part.piece) ++row;
    const std::uint32_t along = part.piece - row * (2 * part.rows - row);
    if (along % 2 == 1) at = Vec2f::Ones() - at;
    at = (at + Vec2f(float(row), float(along / 2))) / float(part.rows);
  } else {
    const auto first = triangles_.begin() + std::ptrdiff_t(starts_[part.instance] + part.triangle);
    const float target = choice * float(part.area);
    const auto chosen = std::partition_point(first, first + part.count - 1,
                                             [&](const Triangle& t) { return t.end <= target; });
    triangle = part.triangle + std::uint32_t(chosen - first);
    if (instance.shading->is_repeated(triangle)) --triangle;
  }
  const Corners corners(instance, triangle);
  Point point;
  point.hit.instance = &instance;
  point.hit.number = part.instance;
  point.hit.triangle = triangle;
  point.hit.u = at.x();
  point.hit.v = at.y();
  point.hit.distance = 1.0f;
  point.hit.normal = corners.ab.cross(corners.ac);
  point.position = corners.a + at.x() * corners.ab + at.y() * corners.ac;
  const float length = point.hit.normal.norm();
  if (length > 0.0f) {
    point.normal = point.hit.normal * ((side % 2 == 1 ? -1.0f : 1.0f) / length);
  } else {
    point.normal = Vec3f::UnitZ();
  }
  return point;
}

}  // namespace diorama
