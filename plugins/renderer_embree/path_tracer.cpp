// SPDX-License-Identifier: Apache-2.0
#include "path_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "path.h"

namespace diorama {
namespace {

// Of paths as bright as behind their first surface. Between 0.7 and 1.5 the error for equal time is
// the same (measured); short paths leave more time for denoised pictures' pixels.
constexpr float kContinuation = 0.7f;

}  // namespace

PathTracer::PathTracer(const RenderScene& scene, const View& view, const TraceSettings& settings,
                       Isa isa)
    : scene_(scene), view_(view), settings_(settings), isa_(isa) {}

RayCounts PathTracer::trace(const TraceJob& job, PixelSum* sums, std::size_t stride) const {
  switch (isa_) {
    case Isa::Sse2:
      break;
    case Isa::Sse42:
      return trace_sse42(job, sums, stride);
    case Isa::Avx2:
      return trace_avx2(job, sums, stride);
    case Isa::Avx512:
      return trace_avx512(job, sums, stride);
  }
  return trace_all(job, sums, stride);
}

// One kernel per instruction set: all that it calls is compiled into it, but for what is rarely
// needed (noinline, and path_special.cpp).
#define DIORAMA_KERNEL(NAME, ARCH)                                        \
  [[gnu::target("arch=" ARCH), gnu::flatten]] RayCounts PathTracer::NAME( \
      const TraceJob& job, PixelSum* sums, std::size_t stride) const {    \
    return trace_all(job, sums, stride);                                  \
  }
DIORAMA_KERNEL(trace_sse42, "x86-64-v2")
DIORAMA_KERNEL(trace_avx2, "x86-64-v3")
DIORAMA_KERNEL(trace_avx512, "x86-64-v4")
#undef DIORAMA_KERNEL

inline RayCounts PathTracer::trace_all(const TraceJob& job, PixelSum* sums,
                                       std::size_t stride) const {
  RayCounts counts;
  std::vector<Path> paths;
  paths.reserve(kBatch);
  Batch batch;
  std::array<PixelSum*, kBatch> pixels;
  BatchFloats columns{};
  BatchFloats rows{};
  const int width = job.x_end - job.x_begin;
  const int area = width * (job.y_end - job.y_begin);
  int next = 0;
  std::uint32_t sample = job.sample_begin;
  while (sample < job.sample_end) {
    paths.clear();
    while (sample < job.sample_end && paths.size() < kBatch) {
      const int x = job.x_begin + next % width;
      const int y = job.y_begin + next / width;
      pixels[paths.size()] = &sums[std::size_t(next / width) * stride + std::size_t(next % width)];
      paths.emplace_back(PathSampler(job.order.place(x, y, sample)));
      columns[paths.size() - 1] = float(x);
      rows[paths.size() - 1] = float(y);
      if (++next < area) continue;
      next = 0;
      ++sample;
    }
    start_paths(paths, columns, rows);
    trace_batch(paths, batch);
    for (std::size_t i = 0; i < paths.size(); ++i) {
      pixels[i]->add(paths[i].result);
      counts.rays += paths[i].counts.rays;
      counts.shadow_rays += paths[i].counts.shadow_rays;
    }
  }
  return counts;
}

inline void PathTracer::start_paths(std::vector<Path>& paths, const BatchFloats& columns,
                                    const BatchFloats& rows) const {
  const Image<RayHit>* hits = settings_.first_hits;
  BatchNumbers numbers;
  for (std::size_t i = 0; i < paths.size(); ++i) numbers.take(i, paths[i].sampler, 2);
  BatchFloats x;
  BatchFloats y;
  for (std::size_t i = 0; i < whole_steps(paths.size()); ++i) {
    const Vec2f u = numbers.pair(i, 0);
    x[i] = columns[i] + (hits ? 0.5f : u.x());
    y[i] = rows[i] + (hits ? 0.5f : u.y());
  }
  for (std::size_t i = 0; i < paths.size(); ++i) {
    Path& path = paths[i];
    const Vec2f aperture = view_.has_aperture() ? numbers.pair(i, 1) : Vec2f(Vec2f::Zero());
    CameraRay ray = view_.sample_ray({x[i], y[i]}, aperture);
    if (view_.has_shutter()) [[unlikely]]
      open_shutter(path, int(rows[i]), ray);
    path.is_over = !(ray.t_max > 0.0f);
    path.go(ray.origin, ray.direction);
    path.t_min = ray.t_min;
    path.t_max = ray.t_max;
    path.spread = view_.pixel_angle();
    if (hits) path.first_hit = &hits->at(int(columns[i]), int(rows[i]));
  }
}

/// Rays to the same light side by side: bundles that go similar ways are traced faster.
inline void PathTracer::arrange_by_light(std::array<Path*, kBatch>& paths, std::size_t count) {
  constexpr std::uint32_t kKeys = 8;
  std::array<std::uint8_t, kBatch> keys;
  std::array<std::uint32_t, kKeys + 1> starts{};
  for (std::size_t i = 0; i < count; ++i) {
    keys[i] = std::uint8_t(paths[i]->shadow.place.light % kKeys);
    ++starts[keys[i] + 1u];
  }
  for (std::uint32_t k = 0; k < kKeys; ++k) starts[k + 1] += starts[k];
  const std::array<Path*, kBatch> before = paths;
  for (std::size_t i = 0; i < count; ++i) paths[starts[keys[i]]++] = before[i];
}

// Paths advance together, step by step: rays of one kind in a row, then the surfaces that they met.
// Code and data of each step stay close to the processor, and memory is fetched meanwhile.
inline void PathTracer::trace_batch(std::vector<Path>& paths, Batch& v) const {
  std::array<Path*, kBatch> active;
  std::array<Path*, kBatch> asking;
  std::size_t count = 0;
  for (Path& path : paths) {
    if (!path.is_over) active[count++] = &path;
  }
  while (count > 0) {
    find_surfaces(std::span(active).first(count), v);
    meet(v);
    v.find_surfaces();
    std::size_t scattered = 0;
    for (std::size_t i = 0; i < v.count; ++i) {
      if (dress(v, i)) v.move(i, scattered++);
    }
    v.count = scattered;
    v.find_bases();
    draw_numbers(v);
    for (std::size_t i = 0; i < v.count; ++i) take_lobes(v, i);
    if (scene_.stacks_lobes()) {
      v.weigh_ways<true>();
    } else {
      v.weigh_ways<false>();
    }
    for (std::size_t i = 0; i < v.count; ++i) scatter(v, i);
    std::size_t asked = 0;
    std::size_t left = 0;
    for (std::size_t i = 0; i < count; ++i) {
      Path* path = active[i];
      if (path->shadow.t_max > 0.0f) asking[asked++] = path;
      if (!path->is_over) active[left++] = path;
    }
    arrange_by_light(asking, asked);
    find_lights(std::span(asking).first(asked));
    count = left;
  }
}

inline void PathTracer::find_surfaces(Paths paths, Batch& v) const {
  v.count = paths.size();
  for (std::size_t i = 0; i < paths.size(); ++i) {
    v.paths[i] = paths[i];
    v.origin.set(i, paths[i]->origin);
    v.direction.set(i, paths[i]->direction);
  }
  if (!paths[0]->first_hit) return trace_rays(v);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    v.hits.set(i, *std::exchange(paths[i]->first_hit, nullptr));
  }
}

inline void PathTracer::send(const LoggedRay& ray, float time, RayBundle& rays) const {
  rays.add(ray.origin, ray.direction, ray.t_min, ray.t_max, time);
  if (settings_.ray_log) [[unlikely]]
    settings_.ray_log->push_back(ray);
}

inline void PathTracer::trace_rays(Batch& v) const {
  RayBundle rays;
  for (std::size_t begin = 0; begin < v.count; begin += RayBundle::kSize) {
    rays.clear();
    for (std::size_t i = begin; i < std::min(begin + RayBundle::kSize, v.count); ++i) {
      Path& path = *v.paths[i];
      send({path.origin, path.direction, path.t_min, path.t_max, false}, path.time, rays);
      ++path.counts.rays;
    }
    scene_.intersect(rays, begin, v.hits);
  }
}

inline void PathTracer::find_lights(Paths paths) const {
  RayBundle rays;
  for (std::size_t begin = 0; begin < paths.size(); begin += RayBundle::kSize) {
    const std::size_t end = std::min(begin + RayBundle::kSize, paths.size());
    rays.clear();
    for (std::size_t i = begin; i < end; ++i) {
      Path& path = *paths[i];
      ShadowRay& shadow = path.shadow;
      send({shadow.origin, shadow.direction, 0.0f, shadow.t_max, true}, path.time, rays);
      ++path.counts.shadow_rays;
      shadow.t_max = 0.0f;
    }
    scene_.transmittance(rays, !settings_.has_caustics, [&](int i, const Vec3f& kept) {
      add_light(*paths[begin + std::size_t(i)], kept);
    });
  }
}

inline void PathTracer::add_light(Path& path, const Vec3f& kept) const {
  const ShadowRay& shadow = path.shadow;
  const Lights& lights = scene_.lights();
  Vec3f radiance;
  if (lights.is_surface(shadow.place)) {
    const MeshInstance& emitter = *scene_.instances()[lights.geometry_of(shadow.place)];
    const std::uint32_t triangle = shadow.place.triangle;
    const Vec2f uv = emitter.uv(triangle, shadow.place.place.x(), shadow.place.place.y());
    radiance = emitter.material(triangle).emission_at(uv, 0.0f);
  } else {
    radiance = lights.radiance_of(shadow.place, shadow.direction);
  }
  add(path, shadow.bounce, shadow.share.cwiseProduct(kept).cwiseProduct(radiance));
}

inline void PathTracer::meet(Batch& v) const {
  scene_.lights().find_near(v.count, v.origin, v.direction, v.may_meet_light);
  for (std::size_t i = 0; i < v.count; ++i) {
    Path& path = *v.paths[i];
    const float distance = v.hits.distance[i];
    const MeshInstance* instance = v.hits.instance[i];
    if (v.may_meet_light[i] != 0 || !instance) collect_lights(path, distance);
    path.is_over = true;
    v.material[i] = nullptr;
    if (!instance) continue;
    path.since_last += distance;
    path.width += path.spread * distance;
    const ShadingMaterial& material = instance->material(std::uint32_t(v.hits.triangle[i]));
    if (path.bounce > settings_.max_bounces && !material.emits) continue;
    v.material[i] = &material;
    v.interpolated.set(i, RenderScene::interpolated_normal(v.hits.at(i)));
    v.is_mirrored[i] = instance->is_mirrored;
  }
}

inline bool PathTracer::dress(Batch& v, std::size_t i) const {
  if (!v.material[i]) return false;
  Path& path = *v.paths[i];
  const ShadingMaterial& material = *v.material[i];
  const bool is_soft = path.is_soft(settings_);
  v.bsdf[i] = is_soft ? &material.soft : &material.sharp;
  const bool has_colors = !v.hits.instance[i]->mesh->colors.empty();
  if (!material.is_special && !has_colors) return true;
  const RayHit hit = v.hits.at(i);
  SurfaceGeometry surface = v.surface(i);
  if (material.reads_uv) RenderScene::add_uv(surface, hit);
  if (material.emits) collect_emission(path, hit, surface, material);
  if (path.bounce > settings_.max_bounces) return false;
  SurfaceBsdf& bsdf = v.own_bsdf[i];
  bsdf = *v.bsdf[i];
  v.bsdf[i] = &bsdf;
  bsdf.is_inside = surface.is_back;
  if (material.is_textured || has_colors) {
    read_textures(path, hit, surface, material, is_soft, bsdf, surface.normal);
    bsdf.finish();
    v.normal.set(i, surface.normal);
  }
  return !(material.is_pane || material.is_veil) || !pass_or_reflect(path, surface, material, bsdf);
}

inline void PathTracer::draw_numbers(Batch& v) const {
  Lights::Wishes& wishes = v.wishes;
  const std::size_t size = whole_steps(v.count);
  wishes.count = v.count;
  wishes.position = v.position;
  wishes.normal = v.normal;
  BatchNumbers numbers;
  for (std::size_t i = 0; i < v.count; ++i) {
    Path& path = *v.paths[i];
    numbers.take(i, path.sampler, Vertices::kPairs);
    wishes.is_two_sided[i] = !path.is_soft(settings_) && v.bsdf[i]->lobes.glass > 0.0f;
  }
  for (std::uint32_t k = 0; k < Vertices::kPairs; ++k) {
    for (std::size_t i = 0; i < size; ++i) {
      const Vec2f pair = numbers.pair(i, k);
      v.numbers[2 * k][i] = pair.x();
      v.numbers[2 * k + 1][i] = pair.y();
    }
  }
  wishes.u = v.numbers[Vertices::kLight];
  scene_.lights().choose(wishes, v.choices);
  // Else their densities stay zero, and none is asked for.
  if (settings_.samples_lights) {
    scene_.lights().sample(wishes, v.choices, v.numbers[Vertices::kPlaceU],
                           v.numbers[Vertices::kPlaceV], v.lights);
  }
}

inline void PathTracer::collect_lights(Path& path, float t_max) const {
  const bool is_first = std::isinf(path.last_density);
  if (path.hides_lights || (!is_first && !settings_.samples_bsdf)) return;
  scene_.lights().along_ray(
      path.origin, path.direction, t_max, path.is_camera_ray,
      [&](std::uint32_t light, const Vec3f& radiance, float density) {
        const bool has_rival = !is_first && settings_.samples_lights;
        const float rival =
            has_rival ? scene_.lights().probability(light, path.last) * density : 0.0f;
        add(path, path.bounce,
            path.throughput.cwiseProduct(radiance) *
                (has_rival ? mis_weight(path.last_density, rival) : 1.0f));
      });
}

inline void PathTracer::take_lobes(Batch& v, std::size_t i) const {
  const SurfaceBsdf& s = *v.bsdf[i];
  v.lobes.set(i, s.lobes);
  v.albedo.set(i, s.albedo_at(v.to_viewer.z[i]));
  v.has_rival[i] = settings_.samples_bsdf && !ends_at(*v.paths[i], s);
}

/// Where the path ends, light samples alone find all light that a rough surface scatters.
inline bool PathTracer::ends_at(const Path& path, const SurfaceBsdf& s) const {
  return path.bounce == settings_.max_bounces && settings_.samples_lights && s.is_rough();
}

inline void PathTracer::scatter(const Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  const SurfaceBsdf& s = *v.bsdf[i];
  if (s.lobes.glass > 0.0f) [[unlikely]]
    return scatter_glass(v, i);
  if (!path.result.has_surface && !s.is_mirror()) {
    record_surface(v, i, s.albedo(v.albedo.at(i)));
  }
  take_light_samples(v, i);
  ask_light(v, i, v.light_share.at(i), v.light_reach[i]);
  path.hides_lights = false;
  if (ends_at(path, s)) return;
  BsdfSample next;
  next.weight = v.next_weight.at(i);
  next.density = v.next_density[i];
  next.spread = v.next_spread[i];
  go_on(v, i, next, v.next.at(i));
}

[[gnu::noinline]] void PathTracer::scatter_glass(const Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  const SurfaceBsdf& s = *v.bsdf[i];
  const Bsdf bsdf(s, v.to_viewer.at(i));
  const bool is_soft = path.is_soft(settings_);
  if (bsdf.has_smooth_part()) {
    if (!path.result.has_surface) record_surface(v, i, bsdf.albedo());
    take_light_samples(v, i);
    light_glass(v, i, bsdf);
  }
  path.is_camera_ray = false;
  const BsdfSample next =
      bsdf.sample(v.numbers[Vertices::kLobe][i], v.pair(Vertices::kDirectionU, i));
  const Vec3f direction = v.basis(i).to_world(next.wi);
  if ((v.flat_normal.at(i).dot(direction) <= 0.0f) != next.is_transmitted) return;
  path.hides_lights =
      path.is_soft(settings_) && (std::isinf(next.density) || (next.is_transmitted && is_soft));
  go_on(v, i, next, direction);
}

inline void PathTracer::light_glass(const Batch& v, std::size_t i, const Bsdf& bsdf) const {
  if (!(v.lights.density[i] > 0.0f)) return;
  const Vec3f towards = v.lights.direction.at(i);
  const Vec3f wi = v.basis(i).to_local(towards);
  const bool is_behind = wi.z() <= 0.0f;
  if (is_behind && v.wishes.is_two_sided[i] == 0) return;
  if ((v.flat_normal.at(i).dot(towards) <= 0.0f) != is_behind) return;
  const BsdfValue value = bsdf.evaluate(wi);
  const float weight = v.weight_of_light(i, settings_.samples_bsdf, value.density);
  ask_light(v, i, value.f_cos * weight, Vertices::reach(v.lights.distance[i]));
}

inline void PathTracer::record_surface(const Batch& v, std::size_t i, const Vec3f& albedo) const {
  Path& path = *v.paths[i];
  path.result.has_surface = true;
  path.result.albedo = path.throughput.cwiseProduct(albedo);
  path.result.normal = v.normal.at(i);
  path.result.position = v.position.at(i);
}

inline void PathTracer::take_light_samples(const Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  path.is_camera_ray = false;
  path.has_scattered = true;
  path.last = v.wishes.receiver(i);
  path.last.total_score = v.choices.total_score[i];
}

/// For `share` of the light's radiance, if nothing within `reach` is in the way.
inline void PathTracer::ask_light(const Batch& v, std::size_t i, const Vec3f& share,
                                  float reach) const {
  if (!(reach > 0.0f) || share.maxCoeff() <= 0.0f) return;
  Path& path = *v.paths[i];
  ShadowRay& shadow = path.shadow;
  shadow.direction = v.lights.direction.at(i);
  shadow.origin = v.leave(i, shadow.direction);
  shadow.t_max = reach;
  shadow.share = path.throughput.cwiseProduct(share);
  shadow.place = v.lights.place(i);
  shadow.bounce = path.bounce;
}

inline void PathTracer::go_on(const Batch& v, std::size_t i, const BsdfSample& next,
                              const Vec3f& direction) const {
  if (!(next.weight.maxCoeff() > 0.0f)) return;
  Path& path = *v.paths[i];
  path.throughput = path.throughput.cwiseProduct(next.weight);
  // Russian roulette, by what is left of the light since the first surface: errors count in
  // proportion to what is seen, so a dark surface's paths are as good as a bright one's.
  const float left = path.throughput.maxCoeff();
  if (path.bounce == 0) path.left_by_first = left;
  // Mirrors seen directly keep all their paths.
  const float first = path.result.has_surface ? settings_.indirect_share : 1.0f;
  const float survival =
      path.bounce == 0 ? first : std::min(0.95f, kContinuation * left / path.left_by_first);
  if (survival < 1.0f) {
    if (v.numbers[Vertices::kRoulette][i] >= survival) return;
    path.throughput *= 1.0f / survival;
  }
  path.is_over = false;
  ++path.bounce;
  path.last_density = next.density;
  path.since_last = 0.0f;
  path.spread = std::max(path.spread, next.spread);
  path.go(v.leave(i, direction), direction);
}

}  // namespace diorama
