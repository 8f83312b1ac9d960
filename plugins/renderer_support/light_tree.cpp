// SPDX-License-Identifier: Apache-2.0
#include "light_tree.h"

#include <numeric>

namespace diorama {

LightTree::LightTree(const std::vector<Light>& lights) : places_(lights.size()) {
  if (lights.empty()) return;
  Range all(lights.size());
  std::iota(all.begin(), all.end(), 0u);
  build(lights, all);
}

void LightTree::set_lane(Block& block, std::uint32_t lane, const Light& light, std::int32_t child) {
  block.x[lane] = light.position.x();
  block.y[lane] = light.position.y();
  block.z[lane] = light.position.z();
  block.radius[lane] = light.radius;
  block.power[lane] = light.power;
  block.direction_x[lane] = light.direction.x();
  block.direction_y[lane] = light.direction.y();
  block.direction_z[lane] = light.direction.z();
  // From 1 in the direction to 0 where the last of its surface turns away: a straight line for flat
  // lights, bent for wider ones.
  const bool has_direction = light.spread <= 1.0f;
  block.spread[lane] = has_direction ? light.spread : 0.0f;
  block.depth[lane] = light.depth;
  block.behind[lane] = light.behind;
  block.slope[lane] = has_direction ? 1.0f / (1.0f + light.spread) : 0.0f;
  block.base[lane] = has_direction ? light.spread / (1.0f + light.spread) : 1.0f;
  block.child[lane] = child;
}

LightTree::Light LightTree::group(const std::vector<Light>& lights, const Range& members) {
  Light whole;
  Vec3f low = lights[members[0]].position;
  Vec3f high = low;
  for (const std::uint32_t i : members) {
    low = low.cwiseMin(lights[i].position - Vec3f::Constant(lights[i].radius));
    high = high.cwiseMax(lights[i].position + Vec3f::Constant(lights[i].radius));
    whole.power += lights[i].power;
  }
  whole.position = 0.5f * (low + high);
  whole.radius = 0.5f * (high - low).norm();
  return whole;
}

/// Splits the members into at most eight groups of neighbours, halving the widest at its middle.
std::uint32_t LightTree::build(const std::vector<Light>& lights, const Range& members) {
  std::vector<Range> groups{members};
  while (groups.size() < kLanes) {
    const auto largest =
        std::max_element(groups.begin(), groups.end(),
                         [](const Range& p, const Range& q) { return p.size() < q.size(); });
    if (largest->size() < 2) break;
    Vec3f low = lights[(*largest)[0]].position;
    Vec3f high = low;
    for (const std::uint32_t i : *largest) {
      low = low.cwiseMin(lights[i].position);
      high = high.cwiseMax(lights[i].position);
    }
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    std::sort(largest->begin(), largest->end(), [&](std::uint32_t p, std::uint32_t q) {
      const float a = lights[p].position[axis];
      const float b = lights[q].position[axis];
      return a != b ? a < b : p < q;
    });
    const auto middle = largest->begin() + std::ptrdiff_t(largest->size() / 2);
    Range second(middle, largest->end());
    largest->erase(middle, largest->end());
    groups.push_back(std::move(second));
  }
  const auto index = std::uint32_t(blocks_.size());
  blocks_.emplace_back();
  blocks_[index].count = std::uint32_t(groups.size());
  for (std::uint32_t lane = 0; lane < groups.size(); ++lane) {
    const Range& own = groups[lane];
    if (own.size() == 1) {
      set_lane(blocks_[index], lane, lights[own[0]], std::int32_t(own[0]));
      places_[own[0]] = {index, lane};
      continue;
    }
    const std::uint32_t child = build(lights, own);
    blocks_[child].parent = index;
    blocks_[child].lane_of_parent = lane;
    set_lane(blocks_[index], lane, group(lights, own), ~std::int32_t(child));
  }
  return index;
}

}  // namespace diorama
