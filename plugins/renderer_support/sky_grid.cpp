// SPDX-License-Identifier: Apache-2.0
#include "sky_grid.h"

#include <algorithm>
#include <utility>

#include "sobol.h"

namespace diorama {
namespace {

// Of a cell at first: one for every patch, and so many more by the patches' light.
constexpr float kFirstRays = 96.0f;
constexpr int kMostFirstRays = 17;  // for one patch
// For a patch that may be seen in part. One that is seen, and is not known to be, is left to what
// surfaces scatter by chance, which find a window rarely.
constexpr float kFurtherRays = 24.0f;
constexpr float kFurtherByLight = 64.0f;  // times as many for a patch with all light
constexpr int kMostFurtherRays = 256;

}  // namespace

SkyGrid::SkyGrid(const DomeTexture& dome) {
  Shares all;
  all.fill(1.0f);
  cells_.push_back(make_cell(dome, all));
  powers_.push_back(cells_[0].power);
}

SkyGrid::SkyGrid(const DomeTexture& dome, const Eigen::Matrix3f& world_from_dome,
                 const Aabb& bounds, const CellGrid::Sees& sees, Host& host)
    : grid_(bounds) {
  const std::vector<Shares> seen = look_around(dome, world_from_dome, sees, host);
  cells_.resize(seen.size());
  host.parallel_for(seen.size(), [&](std::size_t index) {
    cells_[index] = make_cell(dome, with_neighbours(seen, index));
  });
  for (const Cell& cell : cells_) powers_.push_back(cell.power);
}

// Few rays tell which patches are hidden or open all around: there is nothing more to find there.
// The rest goes to what lies between, which in a room are the ways through its windows.
std::vector<SkyGrid::Shares> SkyGrid::look_around(const DomeTexture& dome,
                                                  const Eigen::Matrix3f& world_from_dome,
                                                  const CellGrid::Sees& sees, Host& host) const {
  float total = 0.0f;
  for (int patch = 0; patch < DomeTexture::kPatches; ++patch) total += dome.patch_power(patch);
  RayCounts first{};
  RayCounts further{};
  for (int patch = 0; patch < DomeTexture::kPatches; ++patch) {
    const float light = dome.patch_power(patch);
    if (light <= 0.0f) continue;
    const float share = light / total;
    first[std::size_t(patch)] = std::min(1 + int(kFirstRays * share), kMostFirstRays);
    further[std::size_t(patch)] =
        std::min(int(kFurtherRays * (1.0f + kFurtherByLight * share)), kMostFurtherRays);
  }
  std::vector<Shares> seen(grid_.size());
  host.parallel_for(seen.size(), [&](std::size_t cell) {
    const RayCounts none{};
    seen[cell] = seen_from(cell, dome, world_from_dome, sees, none, first);
  });
  std::vector<Shares> all(seen.size());
  host.parallel_for(seen.size(), [&](std::size_t cell) {
    RayCounts wanted{};
    for (int patch = 0; patch < DomeTexture::kPatches; ++patch) {
      const auto k = std::size_t(patch);
      if (may_be_seen_in_part(seen, cell, patch)) wanted[k] = further[k];
    }
    all[cell] = seen_from(cell, dome, world_from_dome, sees, first, wanted);
    for (std::size_t patch = 0; patch < wanted.size(); ++patch) {
      const int count = first[patch] + wanted[patch];
      if (count == 0) continue;
      all[cell][patch] =
          (float(first[patch]) * seen[cell][patch] + float(wanted[patch]) * all[cell][patch]) /
          float(count);
    }
  });
  return all;
}

bool SkyGrid::may_be_seen_in_part(const std::vector<Shares>& seen, std::size_t cell,
                                  int patch) const {
  bool is_seen = false;
  bool is_hidden = false;
  const auto look_at = [&](std::size_t other_cell, int other_patch) {
    const float share = seen[other_cell][std::size_t(other_patch)];
    is_seen |= share > 0.0f;
    is_hidden |= share < 0.9999f;
  };
  grid_.visit_around(cell, [&](std::size_t other) { look_at(other, patch); });
  // Columns close to a ring.
  const int row = patch / DomeTexture::kColumns;
  const int column = patch % DomeTexture::kColumns;
  for (int r = std::max(row - 1, 0); r <= std::min(row + 1, DomeTexture::kRows - 1); ++r) {
    for (const int c : {column + DomeTexture::kColumns - 1, column, column + 1}) {
      look_at(cell, r * DomeTexture::kColumns + c % DomeTexture::kColumns);
    }
  }
  return is_seen && is_hidden;
}

SkyGrid::Shares SkyGrid::seen_from(std::size_t index, const DomeTexture& dome,
                                   const Eigen::Matrix3f& world_from_dome,
                                   const CellGrid::Sees& sees, const RayCounts& before,
                                   const RayCounts& counts) const {
  Shares seen{};
  std::array<CellGrid::Ray, CellGrid::kMostRays> rays;
  std::array<std::pair<int, float>, CellGrid::kMostRays>
      gains;  ///< Patch and share that each ray stands for.
  std::size_t waiting = 0;
  const auto trace = [&] {
    const std::uint32_t lit = sees({rays.data(), waiting});
    for (std::size_t i = 0; i < waiting; ++i) {
      if (lit >> i & 1u) seen[std::size_t(gains[i].first)] += gains[i].second;
    }
    waiting = 0;
  };
  constexpr std::uint64_t kNumbersPerRay = 5;
  constexpr std::uint64_t kNumbersPerPatch =
      kNumbersPerRay * std::uint64_t(kMostFirstRays + kMostFurtherRays);
  for (int patch = 0; patch < DomeTexture::kPatches; ++patch) {
    const int count = counts[std::size_t(patch)];
    std::uint64_t key = (index * DomeTexture::kPatches + std::uint64_t(patch)) * kNumbersPerPatch +
                        kNumbersPerRay * std::uint64_t(before[std::size_t(patch)]);
    const auto next = [&] { return unit_fraction(mix_bits(++key * 0x9E3779B97F4A7C15u)); };
    for (int i = 0; i < count; ++i) {
      const Vec3f offset(next(), next(), next());
      const Vec3f origin = grid_.place(index, offset);
      const Vec2f u(next(), next());
      const Vec3f direction =
          world_from_dome * DomeTexture::towards(dome.sample(patch, u).place).direction;
      rays[waiting] = {origin, direction};
      gains[waiting] = {patch, 1.0f / float(count)};
      if (++waiting == CellGrid::kMostRays) trace();
    }
  }
  if (waiting > 0) trace();
  return seen;
}

SkyGrid::Shares SkyGrid::with_neighbours(const std::vector<Shares>& seen, std::size_t cell) const {
  Shares shares = seen[cell];
  grid_.visit_beside(cell, [&](std::size_t other) {
    for (std::size_t patch = 0; patch < shares.size(); ++patch) {
      shares[patch] = std::max(shares[patch], CellGrid::kNeighbourShare * seen[other][patch]);
    }
  });
  return shares;
}

SkyGrid::Cell SkyGrid::make_cell(const DomeTexture& dome, const Shares& seen) {
  Cell cell;
  float sum = 0.0f;
  for (std::size_t patch = 0; patch < seen.size(); ++patch) {
    sum += dome.patch_power(int(patch)) * std::max(seen[patch], CellGrid::kUnseenShare);
    cell.cumulative[patch + 1] = sum;
  }
  cell.power = sum;
  if (sum > 0.0f) {
    for (float& c : cell.cumulative) c /= sum;
  }
  return cell;
}

}  // namespace diorama
