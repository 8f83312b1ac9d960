// SPDX-License-Identifier: Apache-2.0
#include "sun_grid.h"

#include <algorithm>
#include <array>
#include <bit>

#include "sampling.h"
#include "sobol.h"

namespace diorama {
namespace {

constexpr std::uint64_t kFirstSunRays = 32;
constexpr std::uint64_t kFurtherSunRays = 224;

}  // namespace

SunGrid::SunGrid(const Vec3f& towards, float one_minus_cos, const Aabb& bounds,
                 const CellGrid::Sees& sees, Host& host)
    : grid_(bounds) {
  const Basis axes = basis_around(towards);
  const auto seen_from = [&](std::size_t cell, std::uint64_t begin, std::uint64_t end) {
    std::uint64_t key = (cell * (kFirstSunRays + kFurtherSunRays) + begin) * 5;
    const auto next = [&] { return unit_fraction(mix_bits(++key * 0x9E3779B97F4A7C15u)); };
    int seen = 0;
    std::array<CellGrid::Ray, CellGrid::kMostRays> rays;
    for (std::uint64_t i = begin; i < end; i += rays.size()) {
      for (CellGrid::Ray& ray : rays) {
        const Vec3f within(next(), next(), next());
        const Vec2f u(next(), next());
        ray = {grid_.place(cell, within), axes.to_world(uniform_cone(u, one_minus_cos))};
      }
      seen += std::popcount(sees(rays));
    }
    return seen;
  };
  std::vector<int> first(grid_.size());
  host.parallel_for(first.size(),
                    [&](std::size_t cell) { first[cell] = seen_from(cell, 0, kFirstSunRays); });
  std::vector<float> seen(first.size());
  host.parallel_for(seen.size(), [&](std::size_t cell) {
    bool is_seen = false;
    bool is_hidden = false;
    grid_.visit_around(cell, [&](std::size_t other) {
      is_seen |= first[other] > 0;
      is_hidden |= first[other] < int(kFirstSunRays);
    });
    std::uint64_t rays = kFirstSunRays;
    int lit = first[cell];
    if (is_seen && is_hidden) {
      lit += seen_from(cell, kFirstSunRays, kFirstSunRays + kFurtherSunRays);
      rays += kFurtherSunRays;
    }
    seen[cell] = float(lit) / float(rays);
  });
  shares_.resize(seen.size());
  for (std::size_t cell = 0; cell < seen.size(); ++cell) {
    float share = std::max(seen[cell], CellGrid::kUnseenShare);
    grid_.visit_beside(cell, [&](std::size_t other) {
      share = std::max(share, CellGrid::kNeighbourShare * seen[other]);
    });
    shares_[cell] = share;
  }
}

}  // namespace diorama
