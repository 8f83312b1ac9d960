// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "bsdf.h"
#include "surface_parts.h"

namespace diorama {

/// Points of surfaces that scatter the light of lamps and sky on to others: the ends of light paths
/// of one bounce (instant radiosity: Keller 1997). A path connects each surface that it meets with
/// one of them, and what its own next surface scatters counts for as much less (multiple importance
/// sampling), so that small bright places, such as the inside of a lampshade, need not be met by
/// chance. Const and shareable between threads.
class VirtualLights {
 public:
  struct Light {
    Vec3f position = Vec3f::Zero();
    Vec3f flat_normal = Vec3f::UnitZ();  ///< On the lit side, unit.
    Vec3f normal = Vec3f::UnitZ();       ///< The same for shading.
    Vec3f to_light = Vec3f::UnitZ();     ///< Where its own light comes from, unit.
    Vec3f irradiance = Vec3f::Zero();    ///< Of a surface that faces it.
    bool is_by_lamp = false;             ///< Not by the sky, or another light without a place.
    SurfaceBsdf bsdf;

    /// What it scatters if all its lobes were diffuse.
    Vec3f mean_radiance() const {
      const float cosine = normal.dot(to_light);
      return irradiance.cwiseProduct(bsdf.albedo(bsdf.albedo_at(cosine))) * (cosine / kPiF);
    }
    /// What it scatters towards a direction, unit, from it.
    Vec3f radiance(const Vec3f& direction, bool stacks_lobes) const;
  };

  /// Shares of the parts' sides: how likely a light lies there. They sum to one, or are all zero.
  VirtualLights(const SurfaceParts& parts, std::span<const double> shares);

  /// `tried`: how many lights were looked for, each on a part drawn by the shares; `found` are
  /// those of them that are lit, `on` their parts' sides.
  void shine(std::vector<Light> found, std::span<const std::uint32_t> on, std::size_t tried);

  /// A share of a light: by four candidates, of which one is chosen by what it would bring.
  struct Choice {
    const Light* light = nullptr;  ///< Null: none would bring anything.
    float rival = 0.0f;            ///< Density of this technique, per square metre; see weights.
    float weight = 0.0f;           ///< For its radiance.
  };
  /// For a surface; both numbers in [0, 1).
  Choice choose(const Vec3f& position, const Vec3f& normal, const Vec3f& flat_normal, float u,
                float pick) const;
  /// The same density anywhere else, for what a path met there.
  float rival(std::uint32_t instance, std::uint32_t triangle, float u, float v,
              bool is_back) const {
    return kCandidates * density_[parts_->part_of(instance, triangle, u, v, is_back)];
  }
  std::size_t size() const { return lights_.size(); }

  /// What choose() reads of a light.
  struct Candidate {
    Vec3f position;
    float density;  ///< Per square metre, of one light.
    Vec3f normal;   ///< flat_normal of the light.
    float brightness;
  };
  // For renderers that choose elsewhere.
  const SurfaceParts& parts() const { return *parts_; }
  std::span<const float> densities() const { return density_; }  ///< By the parts' sides.
  std::span<const Light> lights() const { return lights_; }
  std::span<const Candidate> candidates() const { return candidates_; }

 private:
  static constexpr int kCandidates = 4;

  const SurfaceParts* parts_;
  std::vector<float> density_;  ///< By the parts' sides.
  std::vector<Light> lights_;
  std::vector<Candidate> candidates_;  ///< Of the same numbers.
};

inline Vec3f VirtualLights::Light::radiance(const Vec3f& direction, bool stacks_lobes) const {
  const Basis axes = basis_around(normal);
  Vec3f wo = axes.to_local(direction);
  wo.z() = std::max(wo.z(), 1e-4f);
  wo = unit(wo);
  const Vec3f wi = axes.to_local(to_light);
  const Lobes lobes(bsdf.lobes, bsdf.albedo_at(wo.z()), wo, stacks_lobes);
  return lobes.evaluate(wi, bsdf.albedo_at(wi.z())).f_cos.cwiseProduct(irradiance);
}

inline VirtualLights::Choice VirtualLights::choose(const Vec3f& position, const Vec3f& normal,
                                                   const Vec3f& flat_normal, float u,
                                                   float pick) const {
  if (lights_.empty()) return {};
  const auto size = std::uint32_t(candidates_.size());
  std::array<std::uint32_t, kCandidates> numbers;
  std::array<float, kCandidates> scores;
  float sum = 0.0f;
  for (std::uint32_t k = 0; k < kCandidates; ++k) {
    const float place = (u + float(k)) * (1.0f / kCandidates) * float(size);
    numbers[k] = std::min(std::uint32_t(place), size - 1);
    const Candidate& candidate = candidates_[numbers[k]];
    const Vec3f to = candidate.position - position;
    const float distance2 = to.squaredNorm();
    const float here = normal.dot(to);
    const float there = -candidate.normal.dot(to);
    const bool is_facing = (here > 0.0f) & (there > 0.0f) & (flat_normal.dot(to) > 0.0f);
    const float geometry = here * there / (distance2 * distance2);
    const float rival = kCandidates * candidate.density;
    // As if the surface were diffuse.
    const float score = candidate.brightness * geometry * rival / (rival + geometry / kPiF);
    scores[k] = is_facing ? score : 0.0f;
    sum += scores[k];
  }
  if (!(sum > 0.0f)) return {};
  float rest = pick * sum;
  std::size_t chosen = 0;
  for (std::size_t k = 0; k < kCandidates; ++k) {
    if (!(scores[k] > 0.0f)) continue;
    chosen = k;
    if (rest < scores[k]) break;
    rest -= scores[k];
  }
  const float weight = sum / (scores[chosen] * float(kCandidates));
  return {&lights_[numbers[chosen]], kCandidates * candidates_[numbers[chosen]].density, weight};
}

}  // namespace diorama
