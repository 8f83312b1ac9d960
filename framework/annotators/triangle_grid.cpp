// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/triangle_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace diorama {
namespace {

// Finer grids help no more, and a few large triangles would fill them.
constexpr int kMostCells = 64;
constexpr std::size_t kMostCellsPerTriangle = 32;
// Share of the mesh's size by which rounding may put a point off its surface.
constexpr double kMargin = 1e-4;

/// Weights of the point of a triangle that is nearest to `point`.
std::array<double, 3> nearest_weights(const Vec3& a, const Vec3& b, const Vec3& c,
                                      const Vec3& point) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const auto on_edge = [&](const Vec3& from, const Vec3& to) {
    const double squared = (to - from).squaredNorm();
    return squared > 0.0 ? std::clamp((point - from).dot(to - from) / squared, 0.0, 1.0) : 0.0;
  };
  const Vec3 normal = ab.cross(ac);
  const double squared = normal.squaredNorm();
  if (squared > 0.0) {
    const double v = (point - a).cross(ac).dot(normal) / squared;
    const double w = ab.cross(point - a).dot(normal) / squared;
    if (v >= 0.0 && w >= 0.0 && v + w <= 1.0) return {1.0 - v - w, v, w};
  }
  const double along_ab = on_edge(a, b);
  const double along_bc = on_edge(b, c);
  const double along_ca = on_edge(c, a);
  const std::array<std::array<double, 3>, 3> edges{{{1.0 - along_ab, along_ab, 0.0},
                                                    {0.0, 1.0 - along_bc, along_bc},
                                                    {along_ca, 0.0, 1.0 - along_ca}}};
  return *std::ranges::min_element(edges, {}, [&](const std::array<double, 3>& w) {
    return (w[0] * a + w[1] * b + w[2] * c - point).squaredNorm();
  });
}

}  // namespace

TriangleGrid::TriangleGrid(const Mesh& mesh) : mesh_(mesh), bounds_(mesh.bounds()) {
  if (mesh_.triangles.empty()) return;
  margin_ = std::max(kMargin * bounds_.size().norm(), std::numeric_limits<double>::min());
  int along = std::clamp(int(std::cbrt(double(mesh_.triangles.size()))), 1, kMostCells);
  const std::size_t most = kMostCellsPerTriangle * mesh_.triangles.size();
  while (choose_cells(along) > most && along > 1) along /= 2;
  const std::size_t cells =
      std::size_t(cells_[0]) * std::size_t(cells_[1]) * std::size_t(cells_[2]);
  begins_.assign(cells + 1, 0);
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
    for_each_cell(bounds_of(t), [&](std::size_t cell) { ++begins_[cell + 1]; });
  }
  for (std::size_t cell = 0; cell < cells; ++cell) begins_[cell + 1] += begins_[cell];
  triangles_.resize(begins_.back());
  std::vector<std::size_t> next(begins_.begin(), begins_.end() - 1);
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
    for_each_cell(bounds_of(t),
                  [&](std::size_t cell) { triangles_[next[cell]++] = std::uint32_t(t); });
  }
}

/// Returns in how many cells triangles would be, each counted as often.
std::size_t TriangleGrid::choose_cells(int along_longest) {
  const Vec3 size = bounds_.size();
  cell_size_ = std::max(size.maxCoeff() / along_longest, std::numeric_limits<double>::min());
  for (int axis = 0; axis < 3; ++axis) {
    cells_[std::size_t(axis)] =
        std::clamp(int(std::ceil(size[axis] / cell_size_)), 1, along_longest);
  }
  std::size_t count = 0;
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
    for_each_cell(bounds_of(t), [&](std::size_t) { ++count; });
  }
  return count;
}

/// Wider by what rounding may do.
Aabb TriangleGrid::bounds_of(std::size_t triangle) const {
  Aabb box;
  for (const std::uint32_t corner : mesh_.triangles[triangle]) {
    box.add(mesh_.positions[corner].cast<double>());
  }
  box.min -= Vec3::Constant(margin_);
  box.max += Vec3::Constant(margin_);
  return box;
}

TriangleGrid::Cell TriangleGrid::cell_of(const Vec3& point) const {
  Cell cell{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = (point[Eigen::Index(axis)] - bounds_.min[Eigen::Index(axis)]) / cell_size_;
    cell[axis] = int(std::clamp(std::floor(at), 0.0, double(cells_[axis] - 1)));
  }
  return cell;
}

std::size_t TriangleGrid::number_of(const Cell& cell) const {
  return (std::size_t(cell[0]) * std::size_t(cells_[1]) + std::size_t(cell[1])) *
             std::size_t(cells_[2]) +
         std::size_t(cell[2]);
}

template <class Visit>
void TriangleGrid::for_each_cell(const Aabb& box, const Visit& visit) const {
  const Cell low = cell_of(box.min);
  const Cell high = cell_of(box.max);
  for (int x = low[0]; x <= high[0]; ++x) {
    for (int y = low[1]; y <= high[1]; ++y) {
      for (int z = low[2]; z <= high[2]; ++z) visit(number_of({x, y, z}));
    }
  }
}

std::optional<TriangleGrid::Place> TriangleGrid::place_of(const Vec3& point) const {
  if (triangles_.empty()) return std::nullopt;
  const std::size_t cell = number_of(cell_of(point));
  std::optional<Place> best;
  double best_squared = std::numeric_limits<double>::infinity();
  for (std::size_t i = begins_[cell]; i < begins_[cell + 1]; ++i) {
    const std::uint32_t triangle = triangles_[i];
    const auto& corners = mesh_.triangles[triangle];
    const Vec3 a = mesh_.positions[corners[0]].cast<double>();
    const Vec3 b = mesh_.positions[corners[1]].cast<double>();
    const Vec3 c = mesh_.positions[corners[2]].cast<double>();
    const auto weights = nearest_weights(a, b, c, point);
    const double squared = (weights[0] * a + weights[1] * b + weights[2] * c - point).squaredNorm();
    if (squared >= best_squared) continue;
    best_squared = squared;
    best = Place{triangle, weights};
  }
  return best;
}

}  // namespace diorama
