// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "cell_grid.h"
#include "diorama/host.h"
#include "dome.h"

namespace diorama {

/// Which patches of a dome can be seen from where, in a coarse grid of cells over the scene: in a
/// room, the window. Light samples go there; a rest goes everywhere, because the grid may be wrong.
class SkyGrid {
 public:
  /// One cell that sees everything.
  explicit SkyGrid(const DomeTexture& dome);
  /// By rays from random places of each cell: few at first, more where they do not agree.
  SkyGrid(const DomeTexture& dome, const Eigen::Matrix3f& world_from_dome, const Aabb& bounds,
          const CellGrid::Sees& sees, Host& host);

  const CellGrid& grid() const { return grid_; }
  /// Borders of the patches' shares in a cell, from 0 to 1.
  const std::array<float, DomeTexture::kPatches + 1>& borders(std::uint32_t cell) const {
    return cells_[cell].cumulative;
  }

  /// Luminance times solid angle of what a cell sees.
  float power(std::uint32_t cell) const { return powers_[cell]; }
  void find_powers(const BatchInts& cells, std::size_t size, BatchFloats& powers) const {
    gather(powers_, cells, size, powers);
  }

  struct Choice {
    int patch = 0;
    float probability = 0.0f;
    float rest = 0.0f;  ///< What is left of u: uniform again.
  };
  Choice choose(std::uint32_t cell, float u) const;
  float probability(std::uint32_t cell, int patch) const;

 private:
  struct Cell {
    std::array<float, DomeTexture::kPatches + 1> cumulative{};
    float power = 0.0f;
  };
  using Shares = std::array<float, DomeTexture::kPatches>;
  static Cell make_cell(const DomeTexture& dome, const Shares& seen);
  using RayCounts = std::array<int, DomeTexture::kPatches>;
  /// By cell: which share of each patch can be seen.
  std::vector<Shares> look_around(const DomeTexture& dome, const Eigen::Matrix3f& world_from_dome,
                                  const CellGrid::Sees& sees, Host& host) const;
  bool may_be_seen_in_part(const std::vector<Shares>& seen, std::size_t cell, int patch) const;
  /// By `counts` rays; `before`: how many the cell had.
  Shares seen_from(std::size_t cell, const DomeTexture& dome,
                   const Eigen::Matrix3f& world_from_dome, const CellGrid::Sees& sees,
                   const RayCounts& before, const RayCounts& counts) const;
  Shares with_neighbours(const std::vector<Shares>& seen, std::size_t cell) const;

  CellGrid grid_;
  std::vector<Cell> cells_;
  std::vector<float> powers_;  ///< Of the cells, close together: read at every vertex.
};

inline SkyGrid::Choice SkyGrid::choose(std::uint32_t index, float u) const {
  const auto& cumulative = cells_[index].cumulative;
  const auto patch = std::size_t(interval_of(cumulative.data(), DomeTexture::kPatches, u));
  const float share = cumulative[patch + 1] - cumulative[patch];
  if (!(share > 0.0f)) return {};
  return {int(patch), share, std::clamp((u - cumulative[patch]) / share, 0.0f, 0.9999999f)};
}

inline float SkyGrid::probability(std::uint32_t index, int patch) const {
  const auto& cumulative = cells_[index].cumulative;
  return cumulative[std::size_t(patch) + 1] - cumulative[std::size_t(patch)];
}

}  // namespace diorama
