// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "diorama/host.h"
#include "dome.h"

namespace diorama {

/// Which patches of a dome can be seen from where, in a coarse grid of cells over the scene: in a
/// room, the window. Light samples go there; a rest goes everywhere, because the grid may be wrong.
class SkyGrid {
 public:
  /// Whether a ray to the sky (world space) leaves the scene.
  using Sees = std::function<bool(const Vec3f& origin, const Vec3f& direction)>;

  /// One cell that sees everything.
  explicit SkyGrid(const DomeTexture& dome);
  /// By a few rays per cell and patch.
  SkyGrid(const DomeTexture& dome, const Eigen::Matrix3f& world_from_dome, const Aabb& bounds,
          const Sees& sees, Host& host);

  std::uint32_t cell(const Vec3f& position) const;
  /// Luminance times solid angle of what a cell sees.
  float power(std::uint32_t cell) const { return cells_[cell].power; }

  struct Choice {
    int patch = 0;
    float probability = 0.0f;
    float rest = 0.0f;  ///< What is left of u: uniform again.
  };
  Choice choose(std::uint32_t cell, float u) const;
  float probability(std::uint32_t cell, int patch) const;

 private:
  static constexpr int kCellsLong = 12;  ///< Along the two longest axes; half along the shortest.
  struct Cell {
    std::array<float, DomeTexture::kPatches + 1> cumulative{};
    float power = 0.0f;
  };
  using Shares = std::array<float, DomeTexture::kPatches>;
  static Cell make_cell(const DomeTexture& dome, const Shares& seen);

  Vec3f low_ = Vec3f::Zero();
  Vec3f cells_per_metre_ = Vec3f::Zero();
  std::array<int, 3> counts_{1, 1, 1};
  std::vector<Cell> cells_;
};

}  // namespace diorama
