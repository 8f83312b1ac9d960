// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "sampling.h"

namespace diorama {

/// Where light is wanted.
struct Receiver {
  Vec3f position = Vec3f::Zero();
  Vec3f normal = Vec3f::UnitZ();
  bool is_two_sided = false;  ///< Light from behind counts as well.
  float total_score = 0.0f;   ///< Written by choose_lights().
};

/// Chooses among lights with a place in the scene, in proportion to the light that each would send
/// to a receiver if nothing stood between (estimated). Up to eight are compared with
/// one another; more form a tree whose inner entries stand for groups of neighbours.
class LightTree {
 public:
  struct Light {
    Vec3f position = Vec3f::Zero();
    float radius = 0.0f;                ///< Of a sphere around it.
    Vec3f direction = -Vec3f::UnitZ();  ///< That it shines along, unit.
    /// Sine of the widest angle between the direction and a normal of its surface; above 1: it
    /// shines all around.
    float spread = 2.0f;
    /// A place from which none of the surface can be seen from its front lies further than this
    /// behind the position, plus spread times its distance.
    float depth = 0.0f;
    float behind = 0.0f;  ///< Share of its power that such a place is thought to get.
    float power = 0.0f;   ///< Luminous weight.
  };

  static constexpr std::size_t kLanes = 8;

  using Lanes = std::array<float, kLanes>;
  /// Lights or groups that are compared.
  struct Block {
    alignas(32) Lanes x{}, y{}, z{}, radius{}, power{};
    Lanes direction_x{}, direction_y{}, direction_z{};
    // What leaves the light, by the cosine of its direction.
    Lanes depth{}, slope{}, base{}, spread{}, behind{};
    /// A light, or ~index of a block. Lanes without one have no power.
    std::array<std::int32_t, kLanes> child{};
    std::uint32_t count = 0;
    std::uint32_t parent = 0;
    std::uint32_t lane_of_parent = 0;
  };
  /// Where a light stands.
  struct Place {
    std::uint32_t block = 0;
    std::uint32_t lane = 0;
  };

  LightTree() = default;
  explicit LightTree(const std::vector<Light>& lights);

  /// Lights or groups at the root.
  std::uint32_t root_count() const { return blocks_.empty() ? 0 : blocks_[0].count; }
  float root_score(std::uint32_t lane, const Receiver& receiver) const {
    return score(blocks_[0], lane, receiver);
  }

  /// The root first.
  const std::vector<Block>& blocks() const { return blocks_; }
  /// By light.
  const std::vector<Place>& places() const { return places_; }

  /// The light of a root's lane; negative: it is a group.
  std::int32_t light_of_root(std::uint32_t lane) const { return blocks_[0].child[lane]; }
  bool has_groups() const { return blocks_.size() > 1; }

  struct Choice {
    std::uint32_t light = 0;
    float probability = 0.0f;  ///< Zero: none can contribute.
  };
  /// Among the lights behind one of the root's lanes; u in [0, 1).
  Choice choose(std::uint32_t root_lane, const Receiver& receiver, float u) const;
  /// With which choose() picks this light; the receiver's score of the whole tree is returned too.
  float probability(std::uint32_t light, const Receiver& receiver, float& tree_score) const;

 private:
  using Range = std::vector<std::uint32_t>;

  struct Scores {
    Lanes of{};
    float sum = 0.0f;
  };
  static float score(const Block& block, std::uint32_t lane, const Receiver& receiver);
  static Scores scores(const Block& block, const Receiver& receiver);
  static void set_lane(Block& block, std::uint32_t lane, const Light& light, std::int32_t child);
  static Light group(const std::vector<Light>& lights, const Range& members);
  std::uint32_t build(const std::vector<Light>& lights, const Range& members);

  std::vector<Block> blocks_;
  std::vector<Place> places_;  ///< Per light.
};

// Never zero where light may arrive: cosines are those of the light's whole extent, with a floor
// because a glossy surface weighs directions otherwise than by the cosine. Without branches: made
// for loops over lights and over receivers.
inline float LightTree::score(const Block& b, std::uint32_t i, const Receiver& receiver) {
  constexpr float kFloor = 0.1f;
  const Vec3f to(b.x[i] - receiver.position.x(), b.y[i] - receiver.position.y(),
                 b.z[i] - receiver.position.z());
  const float near2 = std::max(to.squaredNorm(), b.radius[i] * b.radius[i] + 1e-20f);
  const float scale = 1.0f / std::sqrt(near2);
  const float along = receiver.normal.dot(to);
  const float towards = receiver.is_two_sided ? std::abs(along) : along;
  const float cosine = (towards + b.radius[i] * 1.001f) * scale;
  const float at_receiver = cosine > 0.0f ? std::max(kFloor, std::min(1.0f, cosine)) : 0.0f;
  const float height =
      -(to.x() * b.direction_x[i] + to.y() * b.direction_y[i] + to.z() * b.direction_z[i]);
  const float facing = std::min(1.0f, b.slope[i] * ((height + b.depth[i]) * scale) + b.base[i]);
  const float shining = facing * (1.0f + b.spread[i] * (facing - 1.0f));
  const float at_light = select(facing > 0.0f, std::max(kFloor, shining), b.behind[i]);
  return b.power[i] * at_receiver * at_light * scale * scale;
}

inline LightTree::Scores LightTree::scores(const Block& block, const Receiver& receiver) {
  Scores result;
  for (std::uint32_t i = 0; i < kLanes; ++i) result.of[i] = score(block, i, receiver);
  for (std::uint32_t i = 0; i < block.count; ++i) result.sum += result.of[i];
  return result;
}

inline LightTree::Choice LightTree::choose(std::uint32_t root_lane, const Receiver& receiver,
                                           float u) const {
  Choice choice;
  choice.probability = 1.0f;
  std::int32_t child = blocks_[0].child[root_lane];
  while (child < 0) {
    const Block& block = blocks_[std::uint32_t(~child)];
    const Scores scored = scores(block, receiver);
    if (!(scored.sum > 0.0f)) return {};
    const float target = u * scored.sum;
    float before = 0.0f;
    float end = 0.0f;
    std::size_t lane = 0;
    // Rounding may leave the target beyond the last: then the last is taken.
    for (std::size_t i = 0; i < block.count; ++i) {
      if (!(scored.of[i] > 0.0f)) continue;
      lane = i;
      before = end;
      end += scored.of[i];
      if (target < end) break;
    }
    choice.probability *= scored.of[lane] / scored.sum;
    u = std::clamp((target - before) / scored.of[lane], 0.0f, 0.9999999f);
    child = block.child[lane];
  }
  choice.light = std::uint32_t(child);
  return choice;
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
