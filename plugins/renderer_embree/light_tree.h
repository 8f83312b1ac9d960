// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lanes.h"
#include "sampling.h"

namespace diorama {

/// Where light is wanted.
struct Receiver {
  Vec3f position = Vec3f::Zero();
  Vec3f normal = Vec3f::UnitZ();
  bool is_two_sided = false;  ///< Light from behind counts as well.
  float total_score = 0.0f;   ///< Written by Lights::choose.
};

/// Chooses among lights with a place in the scene, in proportion to the light that each would send
/// to a receiver if nothing stood between (estimated). Eight at a time are compared with vector
/// code; more than eight form a tree whose inner entries stand for groups of neighbours.
class LightTree {
 public:
  struct Light {
    Vec3f position = Vec3f::Zero();
    float radius = 0.0f;                ///< Of a sphere around it.
    Vec3f direction = -Vec3f::UnitZ();  ///< That a one-sided light shines along, unit.
    bool is_one_sided = false;
    float power = 0.0f;  ///< Luminous weight.
  };

  LightTree() = default;
  explicit LightTree(const std::vector<Light>& lights);

  struct Scores {
    Lanes of{};
    float sum = 0.0f;
  };
  /// Of the lights or groups at the root.
  Scores root_scores(const Receiver& receiver) const {
    return blocks_.empty() ? Scores() : scores(blocks_[0], receiver);
  }

  struct Choice {
    std::uint32_t light = 0;
    float probability = 0.0f;  ///< Zero: none can contribute.
  };
  /// `root` as root_scores() gives it; u in [0, 1).
  Choice choose(const Receiver& receiver, const Scores& root, float u) const;
  /// With which choose() picks this light; the receiver's score of the whole tree is returned too.
  float probability(std::uint32_t light, const Receiver& receiver, float& tree_score) const;

 private:
  struct Block {
    Lanes x{}, y{}, z{}, radius{}, power{};
    Lanes direction_x{}, direction_y{}, direction_z{}, one_sided{};
    /// A light, or ~index of a block. Lanes without one have no power.
    std::array<std::int32_t, kLanes> child{};
    std::uint32_t count = 0;
    std::uint32_t parent = 0;
    std::uint32_t lane_of_parent = 0;
  };
  struct Place {
    std::uint32_t block = 0;
    std::uint32_t lane = 0;
  };
  using Range = std::vector<std::uint32_t>;

  static Scores scores(const Block& block, const Receiver& receiver);
  static void set_lane(Block& block, int lane, const Light& light, std::int32_t child);
  static Light group(const std::vector<Light>& lights, const Range& members);
  std::uint32_t build(const std::vector<Light>& lights, const Range& members);

  std::vector<Block> blocks_;
  std::vector<Place> places_;  ///< Per light.
};

// Never zero where light may arrive: cosines are those of the light's whole extent, with a floor
// because a glossy surface weighs directions otherwise than by the cosine.
inline LightTree::Scores LightTree::scores(const Block& b, const Receiver& receiver) {
  const Lanes zero{};
  const Lanes floor = zero + 0.1f;
  const Lanes dx = b.x - receiver.position.x();
  const Lanes dy = b.y - receiver.position.y();
  const Lanes dz = b.z - receiver.position.z();
  const Lanes distance2 = dx * dx + dy * dy + dz * dz;
  const Lanes radius2 = b.radius * b.radius + 1e-20f;
  const Lanes near2 = distance2 > radius2 ? distance2 : radius2;
  // 1 / sqrt(near2) to 5e-6: a good guess by the bits, then Newton's method twice.
  using Bits [[gnu::vector_size(4 * kLanes)]] = std::int32_t;
  Lanes scale = Lanes(0x5F3759DF - (Bits(near2) >> 1));
  scale *= 1.5f - 0.5f * near2 * scale * scale;
  scale *= 1.5f - 0.5f * near2 * scale * scale;
  const Vec3f& n = receiver.normal;
  const Lanes along = n.x() * dx + n.y() * dy + n.z() * dz;
  const Lanes positive = along < zero ? -along : along;
  const Lanes towards = receiver.is_two_sided ? positive : along;
  const Lanes cosine = (towards + b.radius * 1.001f) * scale;
  const Lanes at_most_one = cosine < zero + 1.0f ? cosine : zero + 1.0f;
  const Lanes bounded = at_most_one > floor ? at_most_one : floor;
  const Lanes at_receiver = cosine > zero ? bounded : zero;
  const Lanes height = -(dx * b.direction_x + dy * b.direction_y + dz * b.direction_z);
  const Lanes facing = height * scale > floor ? height * scale : floor;
  const Lanes at_flat_light = height > zero ? facing : zero;
  const Lanes at_light = b.one_sided > zero ? at_flat_light : zero + 1.0f;
  Scores result;
  result.of = b.power * at_receiver * at_light * scale * scale;
  for (std::uint32_t i = 0; i < b.count; ++i) result.sum += result.of[i];
  return result;
}

inline LightTree::Choice LightTree::choose(const Receiver& receiver, const Scores& root,
                                           float u) const {
  Choice choice;
  if (!(root.sum > 0.0f)) return choice;
  Scores scored = root;
  std::uint32_t block = 0;
  choice.probability = 1.0f;
  while (true) {
    const float target = u * scored.sum;
    float before = 0.0f;
    float end = 0.0f;
    std::size_t lane = 0;
    // Rounding may leave the target beyond the last: then the last is taken.
    for (std::size_t i = 0; i < blocks_[block].count; ++i) {
      if (!(scored.of[i] > 0.0f)) continue;
      lane = i;
      before = end;
      end += scored.of[i];
      if (target < end) break;
    }
    choice.probability *= scored.of[lane] / scored.sum;
    const std::int32_t child = blocks_[block].child[lane];
    if (child >= 0) {
      choice.light = std::uint32_t(child);
      return choice;
    }
    u = std::clamp((target - before) / scored.of[lane], 0.0f, 0.9999999f);
    block = std::uint32_t(~child);
    scored = scores(blocks_[block], receiver);
    if (!(scored.sum > 0.0f)) return {};
  }
}

inline float LightTree::probability(std::uint32_t light, const Receiver& receiver,
                                    float& tree_score) const {
  Place place = places_[light];
  float probability = 1.0f;
  while (true) {
    const Block& block = blocks_[place.block];
    const Scores scored = scores(block, receiver);
    tree_score = scored.sum;
    if (!(scored.of[place.lane] > 0.0f)) return 0.0f;
    probability *= scored.of[place.lane] / scored.sum;
    if (place.block == 0) return probability;
    place = {block.parent, block.lane_of_parent};
  }
}

}  // namespace diorama
