// SPDX-License-Identifier: Apache-2.0
#include "radiance_cache.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "sobol.h"

namespace diorama {
namespace {

// radiance_cache.glsl of renderer_vulkan has the first two as well.
constexpr float kSize = 0.04f;  // side of the smallest cells over the distance from the eye
constexpr int kLevels = 5;      // of cells, each twice as wide as those before
constexpr std::uint32_t kLeastFindings = 64;  // before a cell is believed
constexpr float kLeastDistance = 1e-6f;
constexpr float kFarthest = 1e9f;  // cells beyond are the same

}  // namespace

std::uint32_t RadianceCache::Place::key() const {
  std::uint32_t hash = hashed_bits(std::uint32_t(exponent) * 8 + std::uint32_t(side));
  for (const int coordinate : at) hash = hashed_bits(hash + std::uint32_t(coordinate));
  return hash | 1u;
}

RadianceCache::Place RadianceCache::place_of(const Vec3f& position, const Vec3f& normal) const {
  const float distance = std::max((position - eye_).norm(), kLeastDistance);
  Place place;
  // The power of two that is next to the wanted size.
  constexpr float kRootOfTwo = 1.41421356f;
  place.exponent = int(std::bit_cast<std::uint32_t>(kRootOfTwo * kSize * distance) >> 23) - 127;
  const auto cells_per_metre = std::bit_cast<float>(std::uint32_t(127 - place.exponent) << 23);
  for (int k = 0; k < 3; ++k) {
    const float cell = std::floor(position[k] * cells_per_metre);
    place.at[std::size_t(k)] = int(std::clamp(cell, -kFarthest, kFarthest));
  }
  Eigen::Index axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  place.side = 2 * int(axis) + (normal[axis] < 0.0f ? 1 : 0);
  return place;
}

// What is seen from nearby is seen in detail: in a corner, behind a curtain.
int RadianceCache::widest(const Place& place, float reach) {
  const int reached =
      int(std::bit_cast<std::uint32_t>(std::max(reach, kLeastDistance)) >> 23) - 127;
  return std::min(place.exponent + kLevels - 1, reached);
}

RadianceCache::RadianceCache(const Vec3f& eye, std::span<const std::span<const Finding>> findings)
    : eye_(eye) {
  fill(known_cells(smallest_cells(findings)));
}

std::vector<RadianceCache::Sums> RadianceCache::smallest_cells(
    std::span<const std::span<const Finding>> findings) const {
  struct Wanted {
    Place place;
    int widest;
    bool operator==(const Wanted&) const = default;
  };
  const auto hash = [](const Wanted& w) {
    return std::size_t(w.place.key()) + std::size_t(w.widest);
  };
  constexpr std::size_t kExpected = 1u << 14;
  std::unordered_map<Wanted, std::size_t, decltype(hash)> numbers(kExpected, hash);
  std::vector<Sums> cells;
  for (const std::span<const Finding>& part : findings) {
    for (const Finding& finding : part) {
      const Place place = place_of(finding.position, finding.normal);
      const Wanted wanted{place, widest(place, finding.reach)};
      if (wanted.widest < place.exponent) continue;
      const auto [entry, is_new] = numbers.emplace(wanted, cells.size());
      if (is_new) cells.push_back({.place = place, .widest = wanted.widest});
      Sums& cell = cells[entry->second];
      ++cell.count;
      cell.weight += finding.weight;
      cell.light += finding.light;
    }
  }
  std::ranges::stable_sort(cells, {}, &Sums::place);
  return cells;
}

// A finding counts in the smallest known cell around it, which is where paths end that come to the
// same place. Did it count in wider ones, too, their light would be that of places that do not ask
// for it: those that are met often would darken, or brighten, those that are met seldom.
std::vector<RadianceCache::Sums> RadianceCache::known_cells(std::vector<Sums> cells) {
  std::vector<Sums> known;
  std::vector<Sums> waiting;  // for the wider cells around them
  auto next = cells.begin();  // by exponent, as they are sorted
  while (next != cells.end() || !waiting.empty()) {
    const int exponent = waiting.empty() ? next->place.exponent : waiting.front().place.exponent;
    std::vector<Sums> level = std::move(waiting);
    waiting.clear();
    for (; next != cells.end() && next->place.exponent == exponent; ++next) level.push_back(*next);
    std::ranges::stable_sort(level, {}, &Sums::place);
    for (std::size_t begin = 0; begin < level.size();) {
      Sums all{.place = level[begin].place};
      std::size_t end = begin;
      for (; end < level.size() && level[end].place == all.place; ++end) {
        all.count += level[end].count;
        all.weight += level[end].weight;
        all.light += level[end].light;
      }
      if (all.count >= kLeastFindings) {
        known.push_back(all);
      } else {
        for (; begin < end; ++begin) {
          Sums& part = level[begin];
          if (part.widest == exponent) continue;
          part.place = part.place.parent();
          waiting.push_back(part);
        }
      }
      begin = end;
    }
  }
  return known;
}

void RadianceCache::fill(std::span<const Sums> cells) {
  constexpr float kLeastWeight = 1e-12f;
  table_.resize(std::bit_ceil(2 * cells.size() + 1));
  for (const Sums& sums : cells) {
    const std::uint32_t key = sums.place.key();
    std::size_t at = first_place(key);
    while (table_[at].key != 0) at = (at + 1) & (table_.size() - 1);
    table_[at] = {sums.light.cwiseQuotient(sums.weight.cwiseMax(kLeastWeight)), key};
  }
}

bool RadianceCache::find(const Vec3f& position, const Vec3f& normal, float reach,
                         Vec3f& light) const {
  Place place = place_of(position, normal);
  for (const int last = widest(place, reach); place.exponent <= last; place = place.parent()) {
    const std::uint32_t wanted = place.key();
    for (std::size_t at = first_place(wanted); table_[at].key != 0;
         at = (at + 1) & (table_.size() - 1)) {
      if (table_[at].key != wanted) continue;
      light = table_[at].light;
      return true;
    }
  }
  return false;
}

}  // namespace diorama
