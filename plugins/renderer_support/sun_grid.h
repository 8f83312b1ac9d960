// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "cell_grid.h"
#include "diorama/host.h"

namespace diorama {

/// From which share of each cell of a coarse grid a distant light is seen: indoors hardly from
/// anywhere, and other lights are chosen there. Nowhere is it zero, because the grid may be wrong.
class SunGrid {
 public:
  /// One cell that sees all of it.
  SunGrid() = default;
  /// By rays `towards` it (unit, world space) from random places of each cell, within a cone of
  /// `one_minus_cos` of its half angle: few at first, more where they do not agree.
  SunGrid(const Vec3f& towards, float one_minus_cos, const Aabb& bounds, const CellGrid::Sees& sees,
          Host& host);

  const CellGrid& grid() const { return grid_; }
  /// By cell, in (0, 1].
  const std::vector<float>& shares() const { return shares_; }
  float share(const Vec3f& position) const { return shares_[grid_.cell(position)]; }
  /// The same for the first `size` entries of a batch.
  void find_shares(const BatchVectors& positions, std::size_t size, BatchFloats& shares) const {
    BatchInts cells;
    grid_.find_cells(positions, size, cells);
    gather(shares_, cells, size, shares);
  }

 private:
  CellGrid grid_;
  std::vector<float> shares_{1.0f};
};

}  // namespace diorama
