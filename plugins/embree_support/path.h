// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "connections.h"
#include "path_reuse.h"
#include "path_tracer.h"
#include "vertices.h"

// Inside of PathTracer: what its kernels and special surfaces share.
namespace diorama {

struct PathTracer::Path {
  explicit Path(PathSampler source, const PathStart& from = {}) : sampler(source), start(from) {}

  PathSampler sampler;
  PathStart start;
  const RayHit* first_hit = nullptr;  ///< Known from the start; see TraceSettings.
  PathSample result;
  Vec3f throughput = Vec3f::Ones();
  float left_by_first = 1.0f;  ///< Largest throughput behind the first scattering surface.
  int bounce = 0;
  int straight_passes = 0;
  std::uint8_t number = 0;  ///< In its batch.
  // See PathReuse.
  bool has_shared_first = false;  ///< Its first surface sees what others found; ...
  bool may_share_next = false;    ///< ... they may see what it meets next, ...
  bool is_shared = false;         ///< ... and what it finds from now on counts for all.
  PathReuse::Found found;
  bool is_camera_ray = true;
  bool has_scattered = false;  ///< Over a surface that is no mirror.
  bool hides_lights = false;   ///< Their light was already counted, or is left out on purpose.
  Receiver last;               ///< The last vertex that took light samples.
  bool is_connected = false;   ///< With a virtual light, from the last vertex.
  float light_share = 1.0f;    ///< What light found from it counts for beside virtual lights.
  float last_density = kInfinite;
  float since_last = 0.0f;         ///< Metres travelled from it.
  float width = 0.0f;              ///< Of the ray's footprint, metres.
  float spread = 0.0f;             ///< Its growth per metre.
  float time = kMoment;            ///< Share of the shutter's window.
  bool ends = false;               ///< In a RadianceCache.
  int finds_from = -1;             ///< Bounce of the finding for a RadianceCache, if it has one.
  RadianceCache::Finding finding;  ///< With what comes from farther bounces.
  bool has_finding() const { return finds_from >= 0; }

  /// Between ways to go on.
  void choose() {
    if (!result.has_surface) result.by_chance = true;
  }
  /// As what it finds a lamp that it meets.
  auto lamp_slot() const {
    return bounce == 2 ? &PathReuse::Found::by_lamp : &PathReuse::Found::by_way_on;
  }
  /// Whether what it meets next is softened, as only caustics would show the difference.
  bool is_soft(const TraceSettings& settings) const {
    return has_scattered && !settings.has_caustics;
  }
};

/// Rays of a batch that ask what is in the way: one from each of these vertices, with columns by
/// the vertices' numbers.
struct PathTracer::RaysFromVertices {
  std::span<const std::uint8_t> vertices;
  const BatchVectors& origin;
  const BatchVectors& direction;
  const BatchFloats& reach;
};

/// The next random numbers of the paths of a batch, for loops over them.
struct BatchNumbers {
  BatchInts keys;
  BatchInts places;

  void take(std::size_t i, PathSampler& sampler, std::uint32_t pairs) {
    keys[i] = std::int32_t(sampler.take(pairs));
    places[i] = std::int32_t(sampler.place());
  }
  Vec2f pair(std::size_t i, std::uint32_t number) const {
    return PathSampler::pair(std::uint32_t(keys[i]) + number * PathSampler::kKeyStep,
                             std::uint32_t(places[i]));
  }
};

/// What became of a path at a surface that may let it through or mirror it.
struct PathTracer::StraightPass {
  bool is_scattered = false;  ///< By the surface's own BSDF, from here on.
  bool goes_on = false;       ///< Along this ray.
  Vec3f origin = Vec3f::Zero();
  Vec3f direction = Vec3f::Zero();
  LeftTriangle left = {};
};

struct PathTracer::Batch : Vertices {
  std::array<Path*, kBatch> paths;  ///< Of `rays`, then of the vertices.
  BatchInts may_hit_light;
  BatchInts bounce;  ///< Of the vertices.

  /// The rays to the lights, those to one light side by side: the vertices that they start from.
  std::array<std::uint8_t, kBatch> shadow_rays;
  std::size_t shadow_ray_count = 0;

  Connections connections;
  std::unique_ptr<PathReuse> reuse;  ///< Null: paths are not reused.

  bool learns = false;  ///< For a RadianceCache.
  BatchRays next_rays;
  std::array<Path*, kBatch> next_paths;
  void go_on(Path& path, const Vec3f& from, const Vec3f& towards, const LeftTriangle& left = {}) {
    next_paths[next_rays.count] = &path;
    next_rays.add(from, towards, 0.0f, kInfinite, path.time, left);
  }

  RayCounts counts;

  /// What is known before find_bases(), to where the entries that scatter stand together.
  void move(std::size_t from, std::size_t to);
};

inline void PathTracer::Batch::move(std::size_t from, std::size_t to) {
  if (from == to) return;
  paths[to] = paths[from];
  rays.direction.set(to, rays.direction.at(from));
  position.set(to, position.at(from));
  flat_normal.set(to, flat_normal.at(from));
  normal.set(to, normal.at(from));
  is_back[to] = is_back[from];
  bsdf[to] = bsdf[from];
  hits.distance[to] = hits.distance[from];
  hits.number[to] = hits.number[from];
  hits.triangle[to] = hits.triangle[from];
  hits.u[to] = hits.u[from];
  hits.v[to] = hits.v[from];
  is_mirrored[to] = is_mirrored[from];
}

inline void PathTracer::add(Path& path, int bounce, const Vec3f& radiance,
                            Vec3f PathReuse::Found::*found) const {
  // Extreme densities may round to a value beyond all numbers, which would spoil its pixel.
  constexpr float kMost = 1e20f;
  if (!(radiance.sum() < kMost)) return;
  Vec3f value = radiance;
  if (!path.has_scattered) {
    path.result.seen += value;
    return;
  }
  if (settings_.clamp > 0.0f && bounce > 1) {
    const float l = luminance(value);
    if (l > settings_.clamp) value *= settings_.clamp / l;
  }
  if (path.is_shared) {
    path.found.*found += value;
    return;
  }
  // The light sample where the finding begins is the path's own.
  if (path.has_finding() && bounce > path.finds_from) {
    path.finding.light += value;
    return;
  }
  path.result.scattered += value;
}

}  // namespace diorama
