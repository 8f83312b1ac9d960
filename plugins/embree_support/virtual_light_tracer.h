// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "path_tracer.h"
#include "renderer_support/sample_plan.h"

namespace diorama {

/// Finds the virtual lights of a picture: on parts of surfaces that are bright, and are seen from
/// where the picture's paths come by. Equal arguments give equal lights, for any number of threads.
class VirtualLightTracer {
 public:
  /// Looks for the parts. `tracer`: of the same scene and view, without virtual lights. All must
  /// outlive this, and `parts` the lights. Adds to `counts`.
  VirtualLightTracer(const EmbreeScene& scene, const View& view, const PathTracer& tracer,
                     const SurfaceParts& parts, std::uint64_t seed, Host& host, RayCounts& counts);

  /// Whether they take away more noise than they take time: where lamps or a sun light a few places
  /// that paths find seldom (measured).
  bool are_worth_it() const;
  /// About so many, the dark ones among them left out; other ones for every `set`. Adds to
  /// `counts`.
  VirtualLights lights(std::size_t count, std::uint64_t set, RayCounts& counts) const;

 private:
  struct Eye {
    Vec3f position;
    Vec3f normal;  ///< Unit, of the triangle, on the side that was seen.
  };
  /// A place on a part, and what it scatters.
  struct Trial {
    Vec3f position = Vec3f::Zero();
    Vec3f normal = Vec3f::UnitZ();
    float brightness = 0.0f;
    float by_small_lights = 0.0f;  ///< Of the brightness.
  };
  template <class Take>
  void light(const std::vector<std::uint32_t>& sides, std::uint64_t purpose, RayCounts& counts,
             Take&& take) const;
  std::vector<Trial> trials(RayCounts& counts) const;
  std::vector<Eye> eyes(RayCounts& counts) const;
  void look_along(const Vec2f& pixel, std::uint64_t number, std::vector<Eye>& eyes,
                  RayCounts& counts) const;
  double seen_share(const Trial& trial, const Eye& eye) const;
  void find_shares(RayCounts& counts);
  double lit_share() const;

  const EmbreeScene& scene_;
  const View& view_;
  const PathTracer& tracer_;
  const SurfaceParts& parts_;
  std::uint64_t seed_;
  Host& host_;
  std::vector<double> shares_;       ///< Of the lights, by the parts' sides.
  double small_lights_share_ = 0.0;  ///< Of what they shine: the rest comes from the sky.
};

/// The virtual lights of a picture's rounds.
class VirtualLightSets {
 public:
  /// For a picture that is to have some, with its first set; null where they are not worth it. Has
  /// `plan` make no round that is too long for a set. All must outlive this. Adds to `counts`.
  static std::unique_ptr<VirtualLightSets> for_picture(const EmbreeScene& scene, const View& view,
                                                       const PathSettings& settings, Isa isa,
                                                       SamplePlan& plan, Host& host,
                                                       RayCounts& counts);
  VirtualLightSets(const VirtualLightSets&) = delete;
  VirtualLightSets& operator=(const VirtualLightSets&) = delete;

  const VirtualLights& lights() const { return lights_; }
  /// For further rounds of the picture.
  void renew(std::span<const TraceJob> jobs, RayCounts& counts);

  /// How many samples of a picture of so many pixels one set serves.
  static std::uint32_t most_samples(std::uint64_t pixels);
  /// Memory that it takes at most in such a scene.
  static std::size_t most_bytes(std::span<const MeshInstance> instances);

 private:
  VirtualLightSets(const EmbreeScene& scene, const View& view, const TraceSettings& settings,
                   Isa isa, std::uint64_t paths, std::uint64_t seed, Host& host, RayCounts& counts);
  void make(std::uint64_t paths, RayCounts& counts);

  SurfaceParts parts_;
  PathTracer alone_;
  VirtualLightTracer tracer_;
  VirtualLights lights_;
  std::uint64_t sets_ = 0;
};

}  // namespace diorama
