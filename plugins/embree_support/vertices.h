// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "embree_scene.h"
#include "renderer_support/bsdf.h"
#include "renderer_support/light_samples.h"

namespace diorama {

/// A step off the surface, far enough that the next ray does not meet it again.
inline Vec3f step_off(const Vec3f& position, const Vec3f& flat_normal) {
  const float x = std::abs(position.x());
  const float y = std::abs(position.y());
  const float z = std::abs(position.z());
  return (2e-5f * (1.0f + std::max(x, std::max(y, z)))) * flat_normal;
}

/// Where a ray starts that goes off to one side or the other.
inline Vec3f leave(const Vec3f& position, const Vec3f& flat_normal, const Vec3f& step,
                   const Vec3f& towards) {
  return position + (towards.dot(flat_normal) < 0.0f ? -step : step);
}

/// Where a ray begins that goes on through a surface.
struct Onward {
  Vec3f origin;
  float back = 0.0f;  ///< Metres before the surface.
  LeftTriangle left;
};

/// A little before it, as it may touch another thing there: a glass stands on a table. Beyond it
/// where the ray that met it began close by: the two would be met in turns.
inline Onward go_through(const Vec3f& position, const Vec3f& flat_normal, const Vec3f& step,
                         const Vec3f& towards, float met_after, const LeftTriangle& triangle) {
  const float cosine = std::max(0.1f, std::abs(towards.dot(flat_normal)));
  const float reach = step.norm() / cosine;
  if (met_after < reach) return {leave(position, flat_normal, step, towards), 0.0f, {}};
  const float back = 0.25f * reach;
  return {position - back * towards, back, triangle};
}

/// LobeWeights of a batch, but for glass, whose paths are scattered one by one.
struct BatchLobes {
  BatchVectors diffuse, f0, multiple;
  BatchFloats f90, alpha, coat, coat_alpha, mean_missing, mean_above, dielectric_f0, burley;

  LobeWeights at(std::size_t i) const {
    LobeWeights w;
    w.diffuse = diffuse.at(i);
    w.f0 = f0.at(i);
    w.f90 = f90[i];
    w.multiple = multiple.at(i);
    w.alpha = alpha[i];
    w.coat = coat[i];
    w.coat_alpha = coat_alpha[i];
    w.mean_missing = mean_missing[i];
    w.mean_above = mean_above[i];
    w.dielectric_f0 = dielectric_f0[i];
    w.burley = burley[i];
    return w;
  }
  void set(std::size_t i, const LobeWeights& w) {
    diffuse.set(i, w.diffuse);
    f0.set(i, w.f0);
    f90[i] = w.f90;
    multiple.set(i, w.multiple);
    alpha[i] = w.alpha;
    coat[i] = w.coat;
    coat_alpha[i] = w.coat_alpha;
    mean_missing[i] = w.mean_missing;
    mean_above[i] = w.mean_above;
    dielectric_f0[i] = w.dielectric_f0;
    burley[i] = w.burley;
  }
};

struct BatchAlbedos {
  BatchFloats f0, f90, coat, above;

  LayerAlbedo at(std::size_t i) const { return {f0[i], f90[i], coat[i], above[i]}; }
  void set(std::size_t i, const LayerAlbedo& n) {
    f0[i] = n.f0;
    f90[i] = n.f90;
    coat[i] = n.coat;
    above[i] = n.above;
  }
};

/// What the paths of a batch met and where they go: one entry for every path under way, then for
/// every one that is scattered, filled step by step. Steps that loop over entries without a branch
/// are vector code. World space where nothing else is said.
struct Vertices {
  std::size_t count = 0;
  BatchRays rays;  ///< That met them.
  BatchHits hits;
  BatchVectors interpolated;  ///< Normal; see interpolated_normal().
  BatchInts is_mirrored;

  BatchVectors position;
  BatchVectors flat_normal;
  BatchVectors normal;
  BatchInts is_back;

  // Of those that scatter.
  enum Purpose { kLight, kRoulette, kPlaceU, kPlaceV, kLobe, kSpare, kDirectionU, kDirectionV };
  static constexpr std::uint32_t kPairs = 4;
  std::array<const SurfaceBsdf*, kBatch> bsdf;
  std::vector<SurfaceBsdf> own_bsdfs;  ///< Of materials that are not the same all over.
  std::array<const ShadingMaterial*, kBatch> material;
  BatchVectors basis_x;
  BatchVectors basis_y;
  BatchVectors to_viewer;                       ///< Local, unit.
  BatchVectors step;                            ///< Off the surface, on the viewer's side.
  std::array<BatchFloats, 2 * kPairs> numbers;  ///< Random ones, by purpose.
  LightQueries queries;
  LightSelections selections;
  LightSamples lights;

  BatchLobes lobes;
  BatchInts has_rival;    ///< The BSDF's own sample may find the light, too.
  BatchAlbedos albedo;    ///< Towards the viewer ...
  BatchAlbedos at_light;  ///< ... the light ...
  BatchAlbedos at_next;   ///< ... and the next vertex.
  BatchVectors to_light;  ///< Local.
  BatchVectors to_next;   ///< Local.

  BatchFloats light_reach;    ///< Of the ray to the light; 0: there is none.
  BatchVectors light_origin;  ///< Of that ray.
  BatchVectors light_share;   ///< Of the light's radiance that is scattered to the viewer.
  BatchVectors next_origin;
  BatchVectors next;         ///< Direction.
  BatchVectors next_weight;  ///< Zero: the path ends.
  BatchFloats next_density;
  BatchFloats next_spread;

  Vec2f pair(Purpose first, std::size_t i) const {
    return {numbers[first][i], numbers[std::size_t(first) + 1][i]};
  }
  Basis basis(std::size_t i) const { return {basis_x.at(i), basis_y.at(i), normal.at(i)}; }
  SurfaceGeometry surface(std::size_t i) const;
  Vec3f leave(std::size_t i, const Vec3f& towards) const {
    return diorama::leave(position.at(i), flat_normal.at(i), step.at(i), towards);
  }

  void find_surfaces();
  void find_bases();
  /// From lobes and lights: the ways to the light and to the next vertex, and how much light takes
  /// them.
  template <bool kStacks>
  void balance_strategies() {
    sample_directions<kStacks>();
    look_up_albedos();
    evaluate_strategies<kStacks>();
  }
  /// How far to look for what hides a light.
  static float reach(float distance) { return std::max(0.0f, distance * 0.9998f - 1e-4f); }
  /// What the light sample counts for: its weight against the BSDF's own sample, where that is a
  /// rival and finds it with this density, over its density.
  float weight_of_light(std::size_t i, bool is_rival, float rival) const {
    const float found = lights.density[i];
    const bool is_point = found == kInfinite;
    const float density = (is_point ? 1.0f : found) * selections.probability[i];
    const bool is_shared = is_rival & !is_point;
    return (is_shared ? mis_weight(density, rival) : 1.0f) / density;
  }

 private:
  template <bool kStacks>
  void sample_directions();
  void look_up_albedos();
  template <bool kStacks>
  void evaluate_strategies();
};

inline SurfaceGeometry Vertices::surface(std::size_t i) const {
  SurfaceGeometry s;
  s.position = position.at(i);
  s.flat_normal = flat_normal.at(i);
  s.normal = normal.at(i);
  s.is_back = is_back[i] != 0;
  return s;
}

inline void Vertices::find_surfaces() {
  for (std::size_t i = 0; i < whole_steps(count); ++i) {
    const Vec3f direction = rays.direction.at(i);
    const Vec3f met = rays.origin.at(i) + hits.distance[i] * direction;
    const SurfaceGeometry s =
        surface_of(met, direction, hits.normal.at(i), interpolated.at(i), is_mirrored[i] != 0);
    position.set(i, s.position);
    flat_normal.set(i, s.flat_normal);
    normal.set(i, s.normal);
    is_back[i] = s.is_back;
  }
}

inline void Vertices::find_bases() {
  for (std::size_t i = 0; i < whole_steps(count); ++i) {
    const Basis basis = basis_around(normal.at(i));
    Vec3f wo = basis.to_local(-rays.direction.at(i));
    wo.z() = std::max(wo.z(), 1e-4f);
    basis_x.set(i, basis.x);
    basis_y.set(i, basis.y);
    to_viewer.set(i, unit(wo));
    step.set(i, step_off(position.at(i), flat_normal.at(i)));
  }
}

template <bool kStacks>
inline void Vertices::sample_directions() {
  for (std::size_t i = 0; i < whole_steps(count); ++i) {
    const Basis axes = basis(i);
    to_light.set(i, axes.to_local(lights.direction.at(i)));
    const Lobes seen(lobes.at(i), albedo.at(i), to_viewer.at(i), kStacks);
    const Vec2f u = pair(kDirectionU, i);
    const Lobes::Draw draw = seen.sample(numbers[kLobe][i], u, cosine_hemisphere(u));
    to_next.set(i, draw.wi);
    next.set(i, axes.to_world(draw.wi));
    next_spread[i] = draw.spread;
  }
}

inline void Vertices::look_up_albedos() {
  for (std::size_t i = 0; i < count; ++i) {
    at_light.set(i, bsdf[i]->albedo_at(to_light.z[i]));
    at_next.set(i, bsdf[i]->albedo_at(to_next.z[i]));
  }
}

template <bool kStacks>
inline void Vertices::evaluate_strategies() {
  for (std::size_t i = 0; i < whole_steps(count); ++i) {
    const Lobes seen(lobes.at(i), albedo.at(i), to_viewer.at(i), kStacks);
    const BsdfValue lit = seen.evaluate(to_light.at(i), at_light.at(i));
    const float weight = weight_of_light(i, has_rival[i] != 0, lit.density);
    // Not light that the interpolated normal would let through the triangle from behind.
    const float before = flat_normal.at(i).dot(lights.direction.at(i));
    const bool is_lit = (lights.density[i] > 0.0f) & (to_light.z[i] > 0.0f) & (before > 0.0f);
    const float distance = reach(lights.distance[i]);
    light_share.set(i, select(is_lit, lit.f_cos * weight, Vec3f::Zero()));
    light_reach[i] = is_lit ? distance : 0.0f;
    light_origin.set(i, leave(i, lights.direction.at(i)));

    const BsdfValue value = seen.evaluate(to_next.at(i), at_next.at(i));
    const float ahead = flat_normal.at(i).dot(next.at(i));
    const bool goes_on = (to_next.z[i] > 0.0f) & (value.density > kLeastDensity) & (ahead > 0.0f);
    next_density[i] = value.density;
    next_origin.set(i, leave(i, next.at(i)));
    next_weight.set(i, select(goes_on, value.f_cos * (1.0f / value.density), Vec3f::Zero()));
  }
}

}  // namespace diorama
