// SPDX-License-Identifier: Apache-2.0
#include "sky_grid.h"

#include <algorithm>

#include "sobol.h"

namespace diorama {
namespace {

constexpr int kRaysPerPatch = 2;
constexpr float kUnseenShare = 0.02f;

float unit(std::uint64_t bits) { return float(bits >> 40) * 0x1p-24f; }

}  // namespace

SkyGrid::SkyGrid(const DomeTexture& dome) {
  Shares all;
  all.fill(1.0f);
  cells_.push_back(make_cell(dome, all));
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
  cells_.resize(std::size_t(counts_[0] * counts_[1] * counts_[2]));
  host.parallel_for(cells_.size(), [&](std::size_t index) {
    const Vec3f corner(float(int(index) % counts_[0]), float(int(index) / counts_[0] % counts_[1]),
                       float(int(index) / counts_[0] / counts_[1]));
    Shares seen{};
    for (int patch = 0; patch < DomeTexture::kPatches; ++patch) {
      if (dome.patch_power(patch) <= 0.0f) continue;
      for (int i = 0; i < kRaysPerPatch; ++i) {
        std::uint64_t key = (index * DomeTexture::kPatches + std::uint64_t(patch)) * kRaysPerPatch +
                            std::uint64_t(i);
        const auto next = [&] { return unit(key = mix_bits(key + 0x9E3779B97F4A7C15u)); };
        const Vec3f offset(next(), next(), next());
        const Vec3f origin = low_ + (corner + offset).cwiseQuotient(cells_per_metre_);
        const Vec2f u(next(), next());
        const Vec3f direction = world_from_dome * dome.sample(patch, u).direction;
        if (sees(origin, direction)) seen[std::size_t(patch)] += 1.0f / kRaysPerPatch;
      }
    }
    cells_[index] = make_cell(dome, seen);
  });
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

std::uint32_t SkyGrid::cell(const Vec3f& position) const {
  int index = 0;
  for (int k = 2; k >= 0; --k) {
    const float x = (position[k] - low_[k]) * cells_per_metre_[k];
    const int last = counts_[std::size_t(k)] - 1;
    index = index * (last + 1) + int(std::clamp(x, 0.0f, float(last)));
  }
  return std::uint32_t(index);
}

SkyGrid::Choice SkyGrid::choose(std::uint32_t index, float u) const {
  const auto& cumulative = cells_[index].cumulative;
  const auto it = std::upper_bound(cumulative.begin() + 1, cumulative.end() - 1, u);
  const auto patch = std::size_t(it - cumulative.begin()) - 1;
  const float share = cumulative[patch + 1] - cumulative[patch];
  if (!(share > 0.0f)) return {};
  return {int(patch), share, std::clamp((u - cumulative[patch]) / share, 0.0f, 0.9999999f)};
}

float SkyGrid::probability(std::uint32_t index, int patch) const {
  const auto& cumulative = cells_[index].cumulative;
  return cumulative[std::size_t(patch) + 1] - cumulative[std::size_t(patch)];
}

}  // namespace diorama
