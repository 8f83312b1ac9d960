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
  /// In whole lines of a processor's cache, as surfaces choose lights all over the table.
  struct alignas(64) Light {
    Vec3f position = Vec3f::Zero();
    Vec3f flat_normal = Vec3f::UnitZ();  ///< On the lit side, unit.
    Vec3f normal = Vec3f::UnitZ();       ///< The same for shading.
    Vec3f to_light = Vec3f::UnitZ();     ///< Where its own light comes from, unit.
    Vec3f irradiance = Vec3f::Zero();    ///< Of a surface that faces it.
    bool is_by_small_light = false;      ///< A lamp or a sun, not the sky around.
    SurfaceBsdf bsdf;

    /// What it scatters if all its lobes were diffuse.
    Vec3f mean_radiance() const {
      const float cosine = normal.dot(to_light);
      return irradiance.cwiseProduct(bsdf.albedo(bsdf.albedo_at(cosine))) * (cosine / kPiF);
    }
  };

  /// Shares of the parts' sides: how likely a light lies there. They sum to one, or are all zero.
  VirtualLights(const SurfaceParts& parts, std::span<const double> shares);

  /// `tried`: how many lights were looked for, each on a part drawn by the shares; `found` are
  /// those of them that are lit, `on` their parts' sides.
  void shine(std::vector<Light> found, std::span<const std::uint32_t> on, std::size_t tried);

  /// Starts to fetch what a connection with a light reads of it.
  void prefetch(std::uint32_t number) const {
    const Light& light = lights_[number];
    __builtin_prefetch(&light);
    __builtin_prefetch(&light.bsdf.row);
    __builtin_prefetch(&light.bsdf.lobes.burley);
  }

  /// Of how many one is chosen for a surface, by what it would bring.
  static constexpr std::uint32_t kCandidates = 4;
  /// By u in [0, 1); there are lights.
  std::uint32_t number_of_candidate(float u, std::uint32_t candidate) const {
    const float place = (u + float(candidate)) * (1.0f / float(kCandidates)) * float(size());
    return std::min(std::uint32_t(place), std::uint32_t(size()) - 1);
  }
  /// The density of candidates, per square metre, where a path met something.
  float rival(std::uint32_t instance, std::uint32_t triangle, float u, float v,
              bool is_back) const {
    return float(kCandidates) * density_[parts_->part_of(instance, triangle, u, v, is_back)];
  }
  /// Fetches what rival() reads first.
  void prefetch_rival(std::uint32_t instance, std::uint32_t triangle) const {
    parts_->prefetch(instance, triangle);
  }
  std::size_t size() const { return lights_.size(); }

  /// What the choice reads of a light; none lies across two lines of a cache.
  struct alignas(32) Candidate {
    Vec3f position;
    float density;  ///< Per square metre, of one light.
    Vec3f normal;   ///< flat_normal of the light.
    float brightness;
  };
  const SurfaceParts& parts() const { return *parts_; }
  std::span<const float> densities() const { return density_; }  ///< By the parts' sides.
  std::span<const Light> lights() const { return lights_; }
  std::span<const Candidate> candidates() const { return candidates_; }

 private:
  const SurfaceParts* parts_;
  std::vector<float> density_;  ///< By the parts' sides.
  std::vector<Light> lights_;
  std::vector<Candidate> candidates_;  ///< Of the same numbers.
};

}  // namespace diorama
