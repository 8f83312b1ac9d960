// SPDX-License-Identifier: Apache-2.0
#include "sky_grid.h"

#include <algorithm>
#include <utility>

#include "sobol.h"

namespace diorama {
namespace {

constexpr int kRaysPerCell = 192;  // beside one for every patch
constexpr int kMostRaysPerPatch = 48;
// The grid may be wrong: what a cell does not see but its neighbour does gets a good share of the
// samples, and everything else a small one.
constexpr float kNeighbourShare = 0.05f;
constexpr float kUnseenShare = 0.003f;

float fraction(std::uint64_t bits) { return float(bits >> 40) * 0x1p-24f; }

}  // namespace

SkyGrid::SkyGrid(const DomeTexture& dome) {
  Shares all;
  all.fill(1.0f);
  cells_.push_back(make_cell(dome, all));
  powers_.push_back(cells_[0].power);
}

SkyGrid::SkyGrid(const DomeTexture& dome, const Eigen::Matrix3f& world_from_dome,
                 const Aabb& bounds, const Sees& sees, Host& host) {
  const Vec3 size = bounds.size().cwiseMax(1e-3);
  Eigen::Index shortest = 0;
  size.minCoeff(&shortest);
  for (Eigen::Index k = 0; k < 3; ++k) {
    counts_[std::size_t(k)] = k == shortest ? kCellsLong / 2 : kCellsLong;
    cells_per_metre_[k] = float(counts_[std::size_t(k)] / size[k]);
  }
  low_ = bounds.min.cast<float>();
  std::vector<Shares> seen(std::size_t(counts_[0] * counts_[1] * counts_[2]));
  host.parallel_for(seen.size(), [&](std::size_t index) {
    seen[index] = seen_from(index, dome, world_from_dome, sees);
  });
  cells_.resize(seen.size());
  host.parallel_for(seen.size(), [&](std::size_t index) {
    cells_[index] = make_cell(dome, with_neighbours(seen, int(index)));
  });
  for (const Cell& cell : cells_) powers_.push_back(cell.power);
}

SkyGrid::Shares SkyGrid::seen_from(std::size_t index, const DomeTexture& dome,
                                   const Eigen::Matrix3f& world_from_dome, const Sees& sees) const {
  float total = 0.0f;
  for (int patch = 0; patch < DomeTexture::kPatches; ++patch) total += dome.patch_power(patch);
  const Vec3f corner(float(int(index) % counts_[0]), float(int(index) / counts_[0] % counts_[1]),
                     float(int(index) / counts_[0] / counts_[1]));
  Shares seen{};
  std::array<Ray, kMostRays> rays;
  std::array<std::pair<int, float>, kMostRays>
      gains;  ///< Patch and share that each ray stands for.
  std::size_t waiting = 0;
  const auto trace = [&] {
    const std::uint32_t lit = sees({rays.data(), waiting});
    for (std::size_t i = 0; i < waiting; ++i) {
      if (lit >> i & 1u) seen[std::size_t(gains[i].first)] += gains[i].second;
    }
    waiting = 0;
  };
  for (int patch = 0; patch < DomeTexture::kPatches; ++patch) {
    const float power = dome.patch_power(patch);
    if (power <= 0.0f) continue;
    const int count = 1 + std::min(int(kRaysPerCell * (power / total)), kMostRaysPerPatch);
    std::uint64_t key = (index * DomeTexture::kPatches + std::uint64_t(patch)) * 1024;
    const auto next = [&] { return fraction(mix_bits(++key * 0x9E3779B97F4A7C15u)); };
    for (int i = 0; i < count; ++i) {
      const Vec3f offset(next(), next(), next());
      const Vec3f origin = low_ + (corner + offset).cwiseQuotient(cells_per_metre_);
      const Vec2f u(next(), next());
      const Vec3f direction =
          world_from_dome * DomeTexture::towards(dome.sample(patch, u).place).direction;
      rays[waiting] = {origin, direction};
      gains[waiting] = {patch, 1.0f / float(count)};
      if (++waiting == kMostRays) trace();
    }
  }
  if (waiting > 0) trace();
  return seen;
}

SkyGrid::Shares SkyGrid::with_neighbours(const std::vector<Shares>& seen, int index) const {
  Shares shares = seen[std::size_t(index)];
  int step = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int place = index / step % counts_[axis];
    for (const int side : {-1, 1}) {
      if (place + side < 0 || place + side >= counts_[axis]) continue;
      const Shares& other = seen[std::size_t(index + side * step)];
      for (std::size_t patch = 0; patch < shares.size(); ++patch) {
        shares[patch] = std::max(shares[patch], kNeighbourShare * other[patch]);
      }
    }
    step *= counts_[axis];
  }
  return shares;
}

SkyGrid::Cell SkyGrid::make_cell(const DomeTexture& dome, const Shares& seen) {
  Cell cell;
  float sum = 0.0f;
  for (std::size_t patch = 0; patch < seen.size(); ++patch) {
    sum += dome.patch_power(int(patch)) * std::max(seen[patch], kUnseenShare);
    cell.cumulative[patch + 1] = sum;
  }
  cell.power = sum;
  if (sum > 0.0f) {
    for (float& c : cell.cumulative) c /= sum;
  }
  return cell;
}

}  // namespace diorama
