// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "renderer_support/virtual_lights.h"
#include "vertices.h"

namespace diorama {

/// The ways from the vertices of a batch to virtual lights: one for each at most, by the vertices'
/// numbers. World space where nothing else is said.
class Connections {
 public:
  BatchInts are_wanted;                       ///< To be set for each vertex ...
  BatchVectors throughput;                    ///< ... and that of its path, up to it, ...
  BatchFloats own_ways;                       ///< ... and as how many its own way on counts.
  std::array<std::uint8_t, kBatch> vertices;  ///< Those that have one; see find().
  std::size_t count = 0;
  BatchVectors origin;
  BatchVectors direction;
  BatchFloats reach;
  BatchVectors light;  ///< What it brings, if nothing is in the way.

  /// The way to the light from a vertex that has one, local to it, and the albedo there.
  Vec3f local(std::size_t i) const { return wi_.at(i); }
  LayerAlbedo albedo(std::size_t i) const { return at_vertex_.at(i); }

  /// Fetches what find() will read of the candidates; the vertices' random numbers are known.
  static void prefetch(const Vertices& v, const VirtualLights& lights);
  /// Chooses a light for each vertex that wants one, by `picks` in [0, 1), and what it brings: the
  /// weight is that of the way over the light beside the path's own way there.
  template <bool kStacks>
  void find(const Vertices& v, const VirtualLights& lights, const BatchFloats& picks);

 private:
  static constexpr std::size_t kCandidates = VirtualLights::kCandidates;

  void score(const Vertices& v, const VirtualLights& lights);
  void choose(const Vertices& v, const VirtualLights& lights, const BatchFloats& picks);
  template <bool kStacks>
  void evaluate(const Vertices& v);

  std::array<BatchFloats, kCandidates> scores_;
  BatchVectors place_;  ///< Of one candidate, then of what was chosen.
  BatchVectors facing_;
  BatchFloats density_;
  BatchFloats brightness_;
  std::array<const VirtualLights::Light*, kBatch> chosen_;
  BatchFloats weight_;
  BatchFloats rival_;
  BatchFloats per_area_;  ///< From solid angle at the vertex.
  BatchVectors normal_;   ///< Of the lights, for shading.
  BatchVectors to_light_;
  BatchVectors irradiance_;
  BatchLobes lobes_;
  BatchAlbedos towards_path_;
  BatchAlbedos towards_light_;
  BatchAlbedos at_vertex_;
  BatchVectors wi_;       ///< Local to the vertex.
  BatchVectors to_path_;  ///< Local to the light's surface, as is the next.
  BatchVectors from_light_;
};

inline void Connections::prefetch(const Vertices& v, const VirtualLights& lights) {
  if (lights.size() == 0) return;
  const BatchFloats& u = v.numbers[Vertices::kSpare];
  for (std::size_t i = 0; i < v.count; ++i) {
    for (std::uint32_t k = 0; k < kCandidates; ++k) {
      __builtin_prefetch(&lights.candidates()[lights.number_of_candidate(u[i], k)]);
    }
  }
}

inline void Connections::score(const Vertices& v, const VirtualLights& lights) {
  const BatchFloats& u = v.numbers[Vertices::kSpare];
  for (std::uint32_t k = 0; k < kCandidates; ++k) {
    for (std::size_t i = 0; i < v.count; ++i) {
      const auto& candidate = lights.candidates()[lights.number_of_candidate(u[i], k)];
      place_.set(i, candidate.position);
      facing_.set(i, candidate.normal);
      density_[i] = candidate.density;
      brightness_[i] = candidate.brightness;
    }
    for (std::size_t i = 0; i < whole_steps(v.count); ++i) {
      const Vec3f to = place_.at(i) - v.position.at(i);
      const float distance2 = to.squaredNorm();
      const float here = v.normal.at(i).dot(to);
      const float there = -facing_.at(i).dot(to);
      const bool is_facing = (here > 0.0f) & (there > 0.0f) & (v.flat_normal.at(i).dot(to) > 0.0f);
      const float geometry = here * there / (distance2 * distance2);
      const float rival = float(kCandidates) * density_[i];
      // As if the surface were diffuse.
      const float score = brightness_[i] * geometry * rival / (rival + geometry / kPiF);
      scores_[k][i] = is_facing & (are_wanted[i] != 0) ? score : 0.0f;
    }
  }
}

inline void Connections::choose(const Vertices& v, const VirtualLights& lights,
                                const BatchFloats& picks) {
  const BatchFloats& u = v.numbers[Vertices::kSpare];
  for (std::size_t i = 0; i < v.count; ++i) {
    float sum = 0.0f;
    for (const BatchFloats& scores : scores_) sum += scores[i];
    chosen_[i] = nullptr;
    if (!(sum > 0.0f)) continue;
    float rest = picks[i] * sum;
    std::uint32_t best = 0;
    for (std::uint32_t k = 0; k < kCandidates; ++k) {
      if (!(scores_[k][i] > 0.0f)) continue;
      best = k;
      if (rest < scores_[k][i]) break;
      rest -= scores_[k][i];
    }
    const std::uint32_t number = lights.number_of_candidate(u[i], best);
    chosen_[i] = &lights.lights()[number];
    lights.prefetch(number);
    weight_[i] = sum / (scores_[best][i] * float(kCandidates));
    rival_[i] = float(kCandidates) * lights.candidates()[number].density;
  }
}

template <bool kStacks>
inline void Connections::evaluate(const Vertices& v) {
  for (std::size_t i = 0; i < whole_steps(v.count); ++i) {
    const Vec3f to = place_.at(i) - v.position.at(i);
    const float distance2 = to.squaredNorm();
    const Vec3f towards = to * (1.0f / std::sqrt(distance2));
    per_area_[i] = -facing_.at(i).dot(towards) / distance2;
    wi_.set(i, v.basis(i).to_local(towards));
    const Basis there = basis_around(normal_.at(i));
    Vec3f wo = there.to_local(-towards);
    wo.z() = std::max(wo.z(), 1e-4f);
    to_path_.set(i, unit(wo));
    from_light_.set(i, there.to_local(to_light_.at(i)));
    // To where the light's own rays begin, too: what lies closer hides neither.
    const Vec3f from = v.position.at(i) + v.step.at(i);
    const Vec3f way = place_.at(i) + step_off(place_.at(i), facing_.at(i)) - from;
    const float length = std::sqrt(way.squaredNorm());
    constexpr float kAlmost = 0.99999f;
    origin.set(i, from);
    direction.set(i, way * (1.0f / length));
    reach[i] = kAlmost * length;
  }
  for (std::size_t i = 0; i < v.count; ++i) {
    if (!chosen_[i]) continue;
    at_vertex_.set(i, v.bsdf[i]->albedo_at(wi_.z[i]));
    towards_path_.set(i, chosen_[i]->bsdf.albedo_at(to_path_.z[i]));
    towards_light_.set(i, chosen_[i]->bsdf.albedo_at(from_light_.z[i]));
  }
  for (std::size_t i = 0; i < whole_steps(v.count); ++i) {
    const Lobes lobes(lobes_.at(i), towards_path_.at(i), to_path_.at(i), kStacks);
    const BsdfValue value = lobes.evaluate(from_light_.at(i), towards_light_.at(i));
    light.set(i, weight_[i] * value.f_cos.cwiseProduct(irradiance_.at(i)));
  }
  for (std::size_t i = 0; i < whole_steps(v.count); ++i) {
    const Lobes lobes(v.lobes.at(i), v.albedo.at(i), v.to_viewer.at(i), kStacks);
    const BsdfValue value = lobes.evaluate(wi_.at(i), at_vertex_.at(i));
    const float own = own_ways[i] * value.density * per_area_[i];
    const float share = per_area_[i] * rival_[i] / (own + rival_[i]);
    light.set(i, light.at(i).cwiseProduct(throughput.at(i)).cwiseProduct(value.f_cos) * share);
  }
}

template <bool kStacks>
inline void Connections::find(const Vertices& v, const VirtualLights& lights,
                              const BatchFloats& picks) {
  count = 0;
  if (lights.size() == 0) return;
  score(v, lights);
  choose(v, lights, picks);
  for (std::size_t i = 0; i < v.count; ++i) {
    if (!chosen_[i]) continue;
    const VirtualLights::Light& own = *chosen_[i];
    place_.set(i, own.position);
    facing_.set(i, own.flat_normal);
    normal_.set(i, own.normal);
    to_light_.set(i, own.to_light);
    irradiance_.set(i, own.irradiance);
    lobes_.set(i, own.bsdf.lobes);
  }
  evaluate<kStacks>(v);
  for (std::size_t i = 0; i < v.count; ++i) {
    if (chosen_[i] && wi_.z[i] > 0.0f) vertices[count++] = std::uint8_t(i);
  }
}

}  // namespace diorama
