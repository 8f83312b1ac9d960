// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "batch.h"

namespace diorama {

/// A coarse grid of cells over a scene. Cells lie row by row from the low corner on, x fastest;
/// places outside belong to the nearest one.
class CellGrid {
 public:
  /// Of light samples: what a few rays from a cell did not see may be seen from it all the same. If
  /// a neighbour sees it, it gets a good share of what it would get there, everything else a small
  /// one.
  static constexpr float kNeighbourShare = 0.2f;
  static constexpr float kUnseenShare = 0.003f;

  /// From a cell, world space.
  struct Ray {
    Vec3f origin;
    Vec3f direction;
  };
  static constexpr std::size_t kMostRays = 8;
  /// Which of up to kMostRays rays leave the scene: one bit each, the first lowest.
  using Sees = std::function<std::uint32_t(std::span<const Ray> rays)>;

  /// One cell for all places.
  CellGrid() = default;
  explicit CellGrid(const Aabb& bounds);

  const Vec3f& low() const { return low_; }
  const Vec3f& cells_per_metre() const { return cells_per_metre_; }
  const std::array<int, 3>& counts() const { return counts_; }
  std::size_t size() const { return std::size_t(counts_[0] * counts_[1] * counts_[2]); }

  std::uint32_t cell(const Vec3f& position) const;
  /// The same for the first `size` entries of a batch.
  void find_cells(const BatchVectors& positions, std::size_t size, BatchInts& cells) const {
    for (std::size_t i = 0; i < size; ++i) cells[i] = std::int32_t(cell(positions.at(i)));
  }
  /// A place of a cell, by numbers in [0, 1).
  Vec3f place(std::size_t cell, const Vec3f& within) const;
  /// Calls `visit` with the cells beside, across faces.
  template <class Visit>
  void visit_beside(std::size_t cell, Visit&& visit) const;
  /// Calls `visit` with the cell and all that touch it.
  template <class Visit>
  void visit_around(std::size_t cell, Visit&& visit) const;

 private:
  static constexpr int kCellsLong = 12;  ///< Along the two longest axes; half along the shortest.
  std::array<int, 3> place_of(std::size_t cell) const {
    const int index = int(cell);
    return {index % counts_[0], index / counts_[0] % counts_[1], index / counts_[0] / counts_[1]};
  }

  Vec3f low_ = Vec3f::Zero();
  Vec3f cells_per_metre_ = Vec3f::Zero();
  std::array<int, 3> counts_{1, 1, 1};
};

inline CellGrid::CellGrid(const Aabb& bounds) {
  const Vec3 size = bounds.size().cwiseMax(1e-3);
  Eigen::Index shortest = 0;
  size.minCoeff(&shortest);
  for (Eigen::Index k = 0; k < 3; ++k) {
    counts_[std::size_t(k)] = k == shortest ? kCellsLong / 2 : kCellsLong;
    cells_per_metre_[k] = float(counts_[std::size_t(k)] / size[k]);
  }
  low_ = bounds.min.cast<float>();
}

inline std::uint32_t CellGrid::cell(const Vec3f& position) const {
  const auto along = [&](int k) {
    const float x = (position[k] - low_[k]) * cells_per_metre_[k];
    return int(std::max(0.0f, std::min(x, float(counts_[std::size_t(k)] - 1))));
  };
  return std::uint32_t((along(2) * counts_[1] + along(1)) * counts_[0] + along(0));
}

inline Vec3f CellGrid::place(std::size_t cell, const Vec3f& within) const {
  const std::array<int, 3> at = place_of(cell);
  const Vec3f corner = Eigen::Vector3i(at[0], at[1], at[2]).cast<float>();
  return low_ + (corner + within).cwiseQuotient(cells_per_metre_);
}

template <class Visit>
void CellGrid::visit_beside(std::size_t cell, Visit&& visit) const {
  const std::array<int, 3> at = place_of(cell);
  int step = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (at[axis] > 0) visit(cell - std::size_t(step));
    if (at[axis] + 1 < counts_[axis]) visit(cell + std::size_t(step));
    step *= counts_[axis];
  }
}

template <class Visit>
void CellGrid::visit_around(std::size_t cell, Visit&& visit) const {
  const std::array<int, 3> at = place_of(cell);
  const auto begin = [&](std::size_t axis) { return std::max(at[axis] - 1, 0); };
  const auto last = [&](std::size_t axis) { return std::min(at[axis] + 1, counts_[axis] - 1); };
  for (int z = begin(2); z <= last(2); ++z) {
    for (int y = begin(1); y <= last(1); ++y) {
      for (int x = begin(0); x <= last(0); ++x) {
        visit(std::size_t((z * counts_[1] + y) * counts_[0] + x));
      }
    }
  }
}

}  // namespace diorama
