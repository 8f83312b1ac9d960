// SPDX-License-Identifier: Apache-2.0
#include "path_tracer.h"

#include <pmmintrin.h>
#include <xmmintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "diorama/abi.h"
#include "path.h"

namespace diorama {
namespace {

// Samples of one pixel that are traced side by side: their first rays go nearly the same way.
constexpr std::uint32_t kRun = 8;
// Metres that textures are read over there.
constexpr float kWidthOfVirtualLights = 0.02f;

/// Numbers too small to matter count as zero while it lives: they are slow otherwise.
class FlushDenormals {
 public:
  FlushDenormals() : before_(_mm_getcsr()) {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned before_;
};

}  // namespace

PathTracer::PathTracer(const EmbreeScene& scene, const View& view, const TraceSettings& settings,
                       Isa isa)
    : scene_(scene), view_(view), settings_(settings), isa_(isa) {}

RayCounts PathTracer::trace(const TraceJob& job, const Output& output) const {
  const FlushDenormals flush;
  switch (isa_) {
    case Isa::Sse2:
      break;
    case Isa::Sse42:
      return trace_sse42(job, output);
    case Isa::Avx2:
      return trace_avx2(job, output);
    case Isa::Avx512:
      return trace_avx512(job, output);
  }
  return trace_all<8>(job, output);
}

PixelPlaces PathTracer::places(const SampleOrder& order) const {
  return {view_.camera().width, view_.camera().height, order};
}

Pixel PathTracer::place(const SampleOrder& order, int x, int y) const {
  return settings_.reuses_paths ? places(order).of(x, y) : Pixel{x, y};
}

Film PathTracer::film(std::span<const TraceJob> jobs, Host& host, RayCounts& counts,
                      const LearningPaths& learning) const {
  const auto learnt = learning.of(jobs);
  // A picture of sums would be larger than what is left of them.
  Film film(view_.camera().width, view_.camera().height);
  std::vector<RayCounts> rays(jobs.size());
  host.parallel_for(jobs.size(), [&](std::size_t i) {
    const TraceJob& job = jobs[i];
    std::vector<PixelSum> sums(job.pixel_count());
    const int width = job.x_end - job.x_begin;
    for (const LearningPaths::Path& path : learnt[i]) {
      sums[std::size_t((path.y - job.y_begin) * width + path.x - job.x_begin)].add(path.sample);
    }
    rays[i] = trace(job, sums.data(), std::size_t(width));
    const PixelSum* sum = sums.data();
    for (int y = job.y_begin; y < job.y_end; ++y) {
      for (int x = job.x_begin; x < job.x_end; ++x) {
        const Pixel pixel = place(job.order, x, y);
        film.at(pixel.x, pixel.y) = (sum++)->mean();
      }
    }
  });
  for (const RayCounts& own : rays) counts += own;
  return film;
}

LearningPaths PathTracer::learn(std::span<const TraceJob> jobs, Host& host,
                                RayCounts& counts) const {
  LearningPaths paths(jobs.size());
  std::vector<RayCounts> rays(jobs.size());
  host.parallel_for(jobs.size(), [&](std::size_t i) {
    paths.part(i).reserve(jobs[i].path_count());
    rays[i] = trace(jobs[i], Output{nullptr, 0, &paths.part(i)});
  });
  for (const RayCounts& own : rays) counts += own;
  return paths;
}

// One kernel per instruction set: all that it calls is compiled into it, but for what is rarely
// needed (noinline, and path_special.cpp). Sanitizers would take many minutes to look through that.
#if DIORAMA_DETAIL_ADDRESS_SANITIZER || DIORAMA_DETAIL_THREAD_SANITIZER
#define DIORAMA_FLATTEN
#else
#define DIORAMA_FLATTEN gnu::flatten
#endif
#define DIORAMA_KERNEL(NAME, ARCH, PACKET_SIZE)                              \
  [[gnu::target("arch=" ARCH), DIORAMA_FLATTEN]] RayCounts PathTracer::NAME( \
      const TraceJob& job, const Output& output) const {                     \
    return trace_all<PACKET_SIZE>(job, output);                              \
  }
DIORAMA_KERNEL(trace_sse42, "x86-64-v2", 8)
DIORAMA_KERNEL(trace_avx2, "x86-64-v3", 8)
DIORAMA_KERNEL(trace_avx512, "x86-64-v4", 16)
#undef DIORAMA_KERNEL
#undef DIORAMA_FLATTEN

template <int kPacketSize>
inline RayCounts PathTracer::trace_all(const TraceJob& job, const Output& output) const {
  std::vector<Path> paths;
  paths.reserve(kBatch);
  Batch batch;
  batch.own_bsdfs.reserve(kBatch);
  batch.learns = output.learning != nullptr;
  if (settings_.reuses_paths) batch.reuse = std::make_unique<PathReuse>();
  const std::uint32_t run = batch.reuse ? PathReuse::kSamples : kRun;
  for (std::uint32_t begin = job.sample_begin; begin < job.sample_end; begin += run) {
    const std::uint32_t end = std::min(begin + run, job.sample_end);
    for (const std::vector<PathStart>& starts :
         batch.reuse ? starts_in_groups(job, places(job.order), begin, end, kBatch)
                     : starts_in_order(job, begin, end, kBatch)) {
      paths.clear();
      for (const PathStart& start : starts) {
        Path& path = paths.emplace_back(
            PathSampler(job.order.place(start.pixel.x, start.pixel.y, start.sample)), start);
        path.number = std::uint8_t(paths.size() - 1);
        if (batch.reuse) batch.reuse->begin(path.number, start.group);
      }
      start_paths(paths, batch);
      trace_batch<kPacketSize>(batch);
      if (batch.reuse) reuse_paths<kPacketSize>(paths, batch);
      for (Path& path : paths) {
        if (output.learning) {
          const float clamp = path.finds_from > 1 ? settings_.clamp : 0.0f;
          const Pixel& pixel = path.start.pixel;
          output.learning->add({pixel.x, pixel.y, path.has_finding(), clamp, path.result},
                               path.finding);
          continue;
        }
        const auto row = std::size_t(path.start.of_job.y - job.y_begin);
        const auto column = std::size_t(path.start.of_job.x - job.x_begin);
        output.sums[row * output.stride + column].add(path.result);
      }
      if (settings_.host) settings_.host->stop_if_asked();
    }
  }
  return batch.counts;
}

inline void PathTracer::start_paths(std::vector<Path>& paths, Batch& v) const {
  const HitImage* hits = settings_.first_hits;
  BatchNumbers numbers;
  for (std::size_t i = 0; i < paths.size(); ++i) numbers.take(i, paths[i].sampler, 2);
  BatchFloats x{};
  BatchFloats y{};
  for (std::size_t i = 0; i < paths.size(); ++i) {
    x[i] = float(paths[i].start.pixel.x);
    y[i] = float(paths[i].start.pixel.y);
  }
  for (std::size_t i = 0; i < whole_steps(paths.size()); ++i) {
    const Vec2f u = numbers.pair(i, 0);
    x[i] += hits ? 0.5f : u.x();
    y[i] += hits ? 0.5f : u.y();
  }
  v.rays.count = 0;
  v.rays.is_coherent = !view_.has_aperture() && !view_.has_shutter();
  for (std::size_t i = 0; i < paths.size(); ++i) {
    Path& path = paths[i];
    const Vec2f aperture = view_.has_aperture() ? numbers.pair(i, 1) : Vec2f(Vec2f::Zero());
    CameraRay ray = view_.sample_ray({x[i], y[i]}, aperture);
    if (view_.has_shutter()) [[unlikely]]
      open_shutter(path, path.start.pixel.y, ray);
    if (!(ray.t_max > 0.0f)) continue;
    path.spread = view_.pixel_angle();
    if (hits) path.first_hit = &hits->at(path.start.pixel.x, path.start.pixel.y);
    v.paths[v.rays.count] = &path;
    v.rays.add(ray.origin, ray.direction, ray.t_min, ray.t_max, path.time);
  }
}

// Paths advance together, step by step: rays of one kind in a row, then the surfaces that they met.
// Code and data of each step stay close to the processor, and memory is fetched meanwhile.
template <int kPacketSize>
inline void PathTracer::trace_batch(Batch& v) const {
  while (v.rays.count > 0) {
    v.next_rays.count = 0;
    v.shadow_ray_count = 0;
    v.own_bsdfs.clear();
    find_surfaces(v);
    process_hits(v);
    v.find_surfaces();
    std::size_t scattered = 0;
    for (std::size_t i = 0; i < v.count; ++i) {
      if (evaluate_material(v, i) && !ends_for_others(v, i)) v.move(i, scattered++);
    }
    v.count = scattered;
    v.find_bases();
    draw_numbers(v);
    if (settings_.virtual_lights) Connections::prefetch(v, *settings_.virtual_lights);
    for (std::size_t i = 0; i < v.count; ++i) take_lobes(v, i);
    if (scene_.stacks_lobes()) {
      v.balance_strategies<true>();
    } else {
      v.balance_strategies<false>();
    }
    for (std::size_t i = 0; i < v.count; ++i) scatter(v, i);
    sort_by_light(v);
    trace_shadow_rays<kPacketSize>(v);
    if (settings_.virtual_lights) connect<kPacketSize>(v);
    v.rays = v.next_rays;
    v.paths = v.next_paths;
  }
}

inline void PathTracer::find_surfaces(Batch& v) const {
  v.count = v.rays.count;
  if (!v.paths[0]->first_hit) return trace_rays(v);
  for (std::size_t i = 0; i < v.count; ++i) {
    v.hits.set(i, *std::exchange(v.paths[i]->first_hit, nullptr));
  }
}

inline void PathTracer::log(const LoggedRay& ray) const {
  if (settings_.ray_log) [[unlikely]]
    settings_.ray_log->push_back(ray);
}

inline void PathTracer::trace_rays(Batch& v) const {
  const BatchRays& rays = v.rays;
  scene_.intersect(rays, v.hits);
  v.counts.rays += rays.count;
  for (std::size_t i = 0; settings_.ray_log && i < rays.count; ++i) {
    log({rays.origin.at(i), rays.direction.at(i), rays.t_min[i], rays.t_max[i], false});
  }
}

/// Rays to the same light side by side: packets that go similar ways are traced faster.
inline void PathTracer::sort_by_light(Batch& v) {
  constexpr std::uint32_t kKeys = 8;
  std::array<std::uint32_t, kKeys + 1> starts{};
  for (std::size_t k = 0; k < v.shadow_ray_count; ++k) {
    ++starts[std::uint32_t(v.lights.light[v.shadow_rays[k]]) % kKeys + 1];
  }
  for (std::uint32_t k = 0; k < kKeys; ++k) starts[k + 1] += starts[k];
  const std::array<std::uint8_t, kBatch> before = v.shadow_rays;
  for (std::size_t k = 0; k < v.shadow_ray_count; ++k) {
    v.shadow_rays[starts[std::uint32_t(v.lights.light[before[k]]) % kKeys]++] = before[k];
  }
}

/// Calls `lit` with every vertex whose ray arrives, and what is left of its light.
template <int kPacketSize, class Lit>
inline void PathTracer::trace_packets(Batch& v, const RaysFromVertices& rays, Passage passage,
                                      Lit&& lit) const {
  RayPacket<kPacketSize> packet;
  for (std::size_t begin = 0; begin < rays.vertices.size(); begin += kPacketSize) {
    const std::size_t end = std::min(begin + kPacketSize, rays.vertices.size());
    packet.clear();
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t i = rays.vertices[k];
      const Vec3f origin = rays.origin.at(i);
      const Vec3f direction = rays.direction.at(i);
      packet.add(origin, direction, 0.0f, rays.reach[i], v.reuse ? kMoment : v.paths[i]->time);
      log({origin, direction, 0.0f, rays.reach[i], true});
    }
    scene_.transmittance(packet, passage, [&](int k, const Vec3f& transmittance) {
      lit(std::size_t(rays.vertices[begin + std::size_t(k)]), transmittance);
    });
  }
  v.counts.shadow_rays += rays.vertices.size();
}

template <int kPacketSize>
inline void PathTracer::trace_shadow_rays(Batch& v) const {
  const RaysFromVertices rays{{v.shadow_rays.data(), v.shadow_ray_count},
                              v.light_origin,
                              v.lights.direction,
                              v.light_reach};
  trace_packets<kPacketSize>(
      v, rays, settings_.has_caustics ? Passage::Panes : Passage::Glass,
      [&](std::size_t i, const Vec3f& transmittance) { add_light_sample(v, i, transmittance); });
}

inline void PathTracer::add_light_sample(const Batch& v, std::size_t i,
                                         const Vec3f& transmittance) const {
  const LightPlace place = v.lights.place(i);
  const LightTable& lights = scene_.lights();
  Vec3f radiance;
  if (lights.is_surface(place)) {
    const MeshInstance& emitter = scene_.instances()[lights.instance_of(place)];
    const Vec2f uv = emitter.uv(place.triangle, place.place.x(), place.place.y());
    radiance = emitter.material(place.triangle).emission_at(uv, 0.0f);
  } else {
    radiance = lights.radiance_of(place, v.lights.direction.at(i));
  }
  using Found = PathReuse::Found;
  add(*v.paths[i], v.bounce[i],
      v.light_share.at(i).cwiseProduct(transmittance).cwiseProduct(radiance),
      v.bounce[i] == 1 ? &Found::by_light : &Found::by_way_on);
}

inline void PathTracer::process_hits(Batch& v) const {
  scene_.lights().find_near(v.count, v.rays.origin, v.rays.direction, v.may_hit_light);
  for (std::size_t i = 0; i < v.count; ++i) {
    Path& path = *v.paths[i];
    const float distance = v.hits.distance[i];
    const MeshInstance* instance = v.hits.instance[i];
    if (v.may_hit_light[i] != 0 || !instance) collect_lights(v, i);
    v.material[i] = nullptr;
    if (!instance) continue;
    path.since_last += distance;
    path.width += path.spread * distance;
    const ShadingMaterial& material = instance->material(std::uint32_t(v.hits.triangle[i]));
    if (path.bounce > settings_.max_bounces && !material.emits) continue;
    v.material[i] = &material;
    if (material.reads_uv) instance->shading->prefetch_uvs(std::uint32_t(v.hits.triangle[i]));
    v.interpolated.set(i, interpolated_normal(v.hits.at(i)));
    v.is_mirrored[i] = instance->is_mirrored;
  }
}

inline bool PathTracer::evaluate_material(Batch& v, std::size_t i) const {
  if (!v.material[i]) return false;
  Path& path = *v.paths[i];
  const ShadingMaterial& material = *v.material[i];
  const bool is_soft = path.is_soft(settings_);
  v.bsdf[i] = is_soft ? &material.soft : &material.sharp;
  const bool has_colors = !v.hits.instance[i]->source().colors.empty();
  if (!material.is_special && !has_colors) return true;
  // Where textures do not tell whether others see it, they need not be read.
  if (material.has_constant_lobes && ends_for_others(v, i)) return false;
  const RayHit hit = v.hits.at(i);
  SurfaceGeometry surface = v.surface(i);
  if (material.reads_uv) add_uv(surface, hit);
  const Vec3f direction = v.rays.direction.at(i);
  if (material.emits) collect_emission(path, direction, hit, surface, material);
  if (path.bounce > settings_.max_bounces) return false;
  SurfaceBsdf& bsdf = v.own_bsdfs.emplace_back(*v.bsdf[i]);
  v.bsdf[i] = &bsdf;
  bsdf.is_inside = surface.is_back;
  if (material.is_textured || has_colors) {
    read_textures(path, direction, hit, surface, material, is_soft, bsdf, surface.normal);
    bsdf.finish();
    v.normal.set(i, surface.normal);
  }
  if (!material.is_thin_glass && !material.is_blended) return true;
  path.may_share_next = false;
  const StraightPass pass_through = pass_or_reflect(path, direction, hit, surface, material, bsdf);
  if (pass_through.goes_on) {
    v.go_on(path, pass_through.origin, pass_through.direction, pass_through.left);
  }
  return pass_through.is_scattered;
}

inline void PathTracer::use_cache(Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  const bool is_wanted = (settings_.cache != nullptr) | v.learns;
  if (!is_wanted || path.has_finding()) return;
  const SurfaceBsdf& s = *v.bsdf[i];
  if (!s.is_rough() || ends_at(path, s)) return;
  const Vec3f weight = path.throughput.cwiseProduct(s.albedo(v.albedo.at(i)));
  if (v.learns) {
    path.finds_from = path.bounce;
    path.finding = {v.position.at(i), v.normal.at(i), path.since_last, weight, Vec3f::Zero()};
    return;
  }
  Vec3f light;
  if (!settings_.cache->find(v.position.at(i), v.normal.at(i), path.since_last, light)) return;
  add(path, path.bounce, weight.cwiseProduct(light));
  path.ends = true;
}

inline void PathTracer::draw_numbers(Batch& v) const {
  LightQueries& queries = v.queries;
  const std::size_t size = whole_steps(v.count);
  queries.count = v.count;
  queries.position = v.position;
  queries.normal = v.normal;
  BatchNumbers numbers;
  for (std::size_t i = 0; i < v.count; ++i) {
    Path& path = *v.paths[i];
    numbers.take(i, path.sampler, Vertices::kPairs);
    queries.is_two_sided[i] = !path.is_soft(settings_) && v.bsdf[i]->lobes.glass > 0.0f;
  }
  for (std::uint32_t k = 0; k < Vertices::kPairs; ++k) {
    for (std::size_t i = 0; i < size; ++i) {
      const Vec2f pair = numbers.pair(i, k);
      v.numbers[2 * k][i] = pair.x();
      v.numbers[2 * k + 1][i] = pair.y();
    }
  }
  queries.u = v.numbers[Vertices::kLight];
  choose_lights(scene_.lights(), queries, v.selections);
  // Else their densities stay zero, and none is points for.
  if (settings_.samples_lights) {
    sample_lights(scene_.lights(), queries, v.selections, v.numbers[Vertices::kPlaceU],
                  v.numbers[Vertices::kPlaceV], v.lights);
  }
}

inline void PathTracer::collect_lights(const Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  const bool is_first = std::isinf(path.last_density);
  if (path.hides_lights || (!is_first && !settings_.samples_bsdf)) return;
  // From the surface that took the light sample, which may lie behind panes: what the sample would
  // have found has its weight there.
  const Vec3f direction = v.rays.direction.at(i);
  const float passed = path.since_last;
  scene_.lights().along_ray(
      v.rays.origin.at(i) - passed * direction, direction, passed, passed + v.hits.distance[i],
      path.is_camera_ray, [&](std::uint32_t light, const Vec3f& radiance, float density) {
        const bool has_rival = !is_first && settings_.samples_lights;
        const float rival =
            has_rival ? choice_probability(scene_.lights(), light, path.last) * density : 0.0f;
        add(path, path.bounce,
            path.throughput.cwiseProduct(radiance) * path.light_share *
                (has_rival ? mis_weight(path.last_density, rival) : 1.0f),
            path.lamp_slot());
      });
}

inline void PathTracer::take_lobes(Batch& v, std::size_t i) const {
  const SurfaceBsdf& s = *v.bsdf[i];
  v.lobes.set(i, s.lobes);
  v.albedo.set(i, s.albedo_at(v.to_viewer.z[i]));
  const Path& path = *v.paths[i];
  v.has_rival[i] = settings_.samples_bsdf && !ends_at(path, s);
  if (path.is_connected) {
    settings_.virtual_lights->prefetch_rival(std::uint32_t(v.hits.number[i]),
                                             std::uint32_t(v.hits.triangle[i]));
  }
}

/// Where the path ends, light samples alone find all light that a rough surface scatters.
inline bool PathTracer::ends_at(const Path& path, const SurfaceBsdf& s) const {
  return path.bounce == settings_.max_bounces && settings_.samples_lights && s.is_rough();
}

inline void PathTracer::scatter(Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  const SurfaceBsdf& s = *v.bsdf[i];
  v.bounce[i] = path.bounce;
  v.connections.are_wanted[i] = 0;
  if (s.lobes.glass > 0.0f) [[unlikely]]
    return scatter_glass(v, i);
  const bool is_first = !path.result.has_surface;
  if (is_first && !s.is_mirror()) {
    record_surface(v, i, s.albedo(v.albedo.at(i)));
  }
  if (!is_first) use_cache(v, i);
  if (v.reuse) share_surface(v, i);
  take_light_samples(v, i);
  path.light_share = path.is_connected && !(path.is_shared && path.bounce == 1)
                         ? share_beside_virtual_lights(v, i)
                         : 1.0f;
  queue_shadow_ray(v, i);
  path.hides_lights = false;
  path.is_connected = settings_.virtual_lights && !path.ends && !s.is_mirror() &&
                      path.bounce < settings_.max_bounces;
  if (path.is_connected) {
    v.connections.are_wanted[i] = 1;
    v.connections.throughput.set(i, path.throughput);
    v.connections.own_ways[i] = is_first_shared(v, path, s) ? PathReuse::kOwnWays : 1.0f;
  }
  if (path.ends || ends_at(path, s)) return;
  BsdfSample next;
  next.weight = v.next_weight.at(i);
  next.density = v.next_density[i];
  next.spread = v.next_spread[i];
  go_on(v, i, next, v.next_origin.at(i), v.next.at(i));
}

[[gnu::noinline]] void PathTracer::scatter_glass(Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  const SurfaceBsdf& s = *v.bsdf[i];
  const Bsdf bsdf(s, v.to_viewer.at(i));
  const bool is_soft = path.is_soft(settings_);
  path.is_connected = false;
  path.light_share = 1.0f;
  if (bsdf.has_smooth_part()) {
    if (!path.result.has_surface) record_surface(v, i, bsdf.albedo());
    take_light_samples(v, i);
    light_glass(v, i, bsdf);
    queue_shadow_ray(v, i);
  }
  path.is_camera_ray = false;
  path.choose();
  const BsdfSample next =
      bsdf.sample(v.numbers[Vertices::kLobe][i], v.pair(Vertices::kDirectionU, i));
  const Vec3f direction = v.basis(i).to_world(next.wi);
  if ((v.flat_normal.at(i).dot(direction) <= 0.0f) != next.is_transmitted) return;
  path.hides_lights =
      path.is_soft(settings_) && (std::isinf(next.density) || (next.is_transmitted && is_soft));
  if (!next.is_transmitted) return go_on(v, i, next, v.leave(i, direction), direction);
  const Onward onward = go_through(v.position.at(i), v.flat_normal.at(i), v.step.at(i), direction,
                                   v.hits.distance[i], {v.hits.number[i], v.hits.triangle[i]});
  go_on(v, i, next, onward.origin, direction, onward.left);
}

/// What Vertices finds of the way to the light for other surfaces.
inline void PathTracer::light_glass(Batch& v, std::size_t i, const Bsdf& bsdf) const {
  v.light_reach[i] = 0.0f;
  if (!(v.lights.density[i] > 0.0f)) return;
  const Vec3f towards = v.lights.direction.at(i);
  const Vec3f wi = v.basis(i).to_local(towards);
  const bool is_behind = wi.z() <= 0.0f;
  if (is_behind && v.queries.is_two_sided[i] == 0) return;
  if ((v.flat_normal.at(i).dot(towards) <= 0.0f) != is_behind) return;
  const BsdfValue value = bsdf.evaluate(wi);
  v.light_share.set(i, value.f_cos * v.weight_of_light(i, settings_.samples_bsdf, value.density));
  v.light_reach[i] = Vertices::reach(v.lights.distance[i]);
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
  path.last = v.queries.receiver(i);
  path.last.total_score = v.selections.total_score[i];
}

/// What comes of the light's share, if nothing within its reach is in the way.
inline void PathTracer::queue_shadow_ray(Batch& v, std::size_t i) const {
  const Vec3f share = v.light_share.at(i);
  if (!(v.light_reach[i] > 0.0f) || share.maxCoeff() <= 0.0f) return;
  const Path& path = *v.paths[i];
  v.light_share.set(i, path.light_share * path.throughput.cwiseProduct(share));
  v.shadow_rays[v.shadow_ray_count++] = std::uint8_t(i);
}

inline void PathTracer::go_on(Batch& v, std::size_t i, const BsdfSample& next, const Vec3f& origin,
                              const Vec3f& direction, const LeftTriangle& behind) const {
  if (!(next.weight.maxCoeff() > 0.0f)) return;
  Path& path = *v.paths[i];
  path.throughput = path.throughput.cwiseProduct(next.weight);
  // Russian roulette, by what is left of the light since the first surface: errors count in
  // proportion to what is seen, so a dark surface's paths are as good as a bright one's.
  const float left = path.throughput.maxCoeff();
  if (path.bounce == 0) path.left_by_first = left;
  // Mirrors seen directly keep all their paths.
  const float first = path.result.has_surface ? settings_.indirect_share : 1.0f;
  const float survival = path.bounce == 0
                             ? first
                             : std::min(0.95f, settings_.continuation * left / path.left_by_first);
  if (survival < 1.0f) {
    if (v.numbers[Vertices::kRoulette][i] >= survival) return;
    path.throughput *= 1.0f / survival;
  }
  ++path.bounce;
  path.last_density = next.density;
  path.since_last = 0.0f;
  path.spread = std::max(path.spread, std::min(next.spread, kMostSpread));
  v.go_on(path, origin, direction, behind);
}

float PathTracer::rival_of_virtual_lights(const Batch& v, std::size_t i) const {
  if (!v.paths[i]->is_connected) return 0.0f;
  const bool is_back = (v.is_back[i] != 0) != (v.is_mirrored[i] != 0);
  return settings_.virtual_lights->rival(std::uint32_t(v.hits.number[i]),
                                         std::uint32_t(v.hits.triangle[i]), v.hits.u[i],
                                         v.hits.v[i], is_back);
}

float PathTracer::share_beside_virtual_lights(const Batch& v, std::size_t i) const {
  const Path& path = *v.paths[i];
  const float cosine = std::abs(v.flat_normal.at(i).dot(v.rays.direction.at(i)));
  // Per square metre, here.
  float own = path.last_density * cosine / (path.since_last * path.since_last);
  if (path.has_shared_first && path.bounce == 1) own *= PathReuse::kOwnWays;
  return own / (own + rival_of_virtual_lights(v, i));
}

template <int kPacketSize>
inline void PathTracer::connect(Batch& v) const {
  Connections& connections = v.connections;
  BatchFloats picks;
  for (std::size_t i = 0; i < v.count; ++i) {
    const auto spare = std::bit_cast<std::uint32_t>(v.numbers[Vertices::kSpare][i]);
    picks[i] = PathSampler::fraction(hashed_bits(spare + hashed_bits(v.paths[i]->sampler.place())));
  }
  if (scene_.stacks_lobes()) {
    connections.find<true>(v, *settings_.virtual_lights, picks);
  } else {
    connections.find<false>(v, *settings_.virtual_lights, picks);
  }
  const RaysFromVertices rays{{connections.vertices.data(), connections.count},
                              connections.origin,
                              connections.direction,
                              connections.reach};
  // Glass would bend them: paths find their own way through it.
  trace_packets<kPacketSize>(
      v, rays, Passage::Panes, [&](std::size_t i, const Vec3f& transmittance) {
        Path& path = *v.paths[i];
        const bool is_second = path.is_shared && v.bounce[i] == 1;
        if (is_second)
          v.reuse->set_connection(path.number, connections.local(i), connections.albedo(i));
        using Found = PathReuse::Found;
        add(path, v.bounce[i] + 1, connections.light.at(i).cwiseProduct(transmittance),
            is_second ? &Found::by_connection : &Found::by_way_on);
      });
}

inline bool PathTracer::is_first_shared(const Batch& v, const Path& path, const SurfaceBsdf& s) {
  // Metal looks where others do not.
  constexpr float kMostMetallic = 0.5f;
  return v.reuse && path.bounce == 0 && s.metallic < kMostMetallic && s.lobes.glass <= 0.0f;
}

/// What is seen of it from elsewhere must not be far from what its own path saw.
inline bool PathTracer::can_be_second(const SurfaceBsdf& s) {
  constexpr float kLeastAlpha = 0.1f;
  return s.lobes.glass <= 0.0f && s.alpha >= kLeastAlpha &&
         (s.layers.coat <= 0.0f || s.layers.coat_alpha >= kLeastAlpha);
}

/// Of the second surfaces only some are looked at, which serve the others' paths, too.
inline bool PathTracer::ends_for_others(const Batch& v, std::size_t i) {
  const Path& path = *v.paths[i];
  return path.may_share_next && !path.start.goes_on && can_be_second(*v.bsdf[i]);
}

inline void PathTracer::share_surface(Batch& v, std::size_t i) const {
  Path& path = *v.paths[i];
  const SurfaceBsdf& s = *v.bsdf[i];
  if (is_first_shared(v, path, s)) {
    v.reuse->set_first(path.number, v, i, path.throughput);
    path.may_share_next = true;
    path.has_shared_first = true;
    return;
  }
  if (path.may_share_next && can_be_second(s)) {
    v.reuse->set_second(path.number, v, i, path.throughput, rival_of_virtual_lights(v, i));
    path.is_shared = true;
  }
  path.may_share_next = false;
}

template <int kPacketSize>
inline void PathTracer::reuse_paths(std::vector<Path>& paths, Batch& v) const {
  for (const Path& path : paths) {
    constexpr std::uint32_t kKey = 0x5eed5u;  // Of numbers that nothing else draws.
    const std::uint32_t bits = hashed_bits(kKey + hashed_bits(path.sampler.place()));
    v.reuse->set_found(path.number, path.found, PathSampler::fraction(bits));
  }
  const auto trace = [&](const std::uint8_t* vertices, std::size_t count,
                         const BatchVectors& origin, const BatchVectors& direction,
                         const BatchFloats& reach, auto&& seen) {
    const RaysFromVertices rays{{vertices, count}, origin, direction, reach};
    // What is seen through a pane its own path alone finds.
    trace_packets<kPacketSize>(v, rays, Passage::CutOuts,
                               [&](std::size_t w, const Vec3f&) { seen(w); });
  };
  const auto give = [&](std::size_t i, const Vec3f& light) {
    paths[i].is_shared = false;
    add(paths[i], 1, light);
  };
  if (scene_.stacks_lobes()) {
    v.reuse->connect<true>(trace, give);
  } else {
    v.reuse->connect<false>(trace, give);
  }
}

/// Has paths arrive there straight from above, as if they had been scattered before.
void PathTracer::place_on_surfaces(std::span<const SurfaceParts::Point> places, std::uint32_t key,
                                   std::uint32_t first, std::vector<Path>& paths, Batch& v) const {
  v.rays.count = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const SurfaceParts::Point& place = places[i];
    Path& path = paths.emplace_back(PathSampler({key, first + std::uint32_t(i)}));
    path.sampler.take(2);  // These made the place.
    path.has_scattered = true;
    path.hides_lights = true;
    path.width = kWidthOfVirtualLights;
    v.paths[i] = &path;
    v.hits.set(i, place.hit);
    v.rays.add(place.position + place.normal, -place.normal, 0.0f, kInfinite, kMoment);
    const MeshInstance& instance = *place.hit.instance;
    v.material[i] = &instance.material(place.hit.triangle);
    v.interpolated.set(i, interpolated_normal(place.hit));
    v.is_mirrored[i] = instance.is_mirrored;
  }
  v.count = places.size();
  v.find_surfaces();
  // Where two surfaces lie one on the other, paths meet one of them.
  BatchRays down = v.rays;
  for (std::size_t i = 0; i < v.count; ++i) {
    const Vec3f step = 1.5f * step_off(v.position.at(i), v.flat_normal.at(i));
    down.origin.set(i, v.position.at(i) + step);
    down.t_max[i] = 2.0f * step.norm();
  }
  BatchHits met;
  scene_.intersect(down, met);
  v.counts.rays += v.count;
  for (std::size_t i = 0; i < v.count; ++i) {
    const bool is_met =
        met.instance[i] == v.hits.instance[i] && met.triangle[i] / 2 == v.hits.triangle[i] / 2;
    if (!is_met) v.material[i] = nullptr;
  }
}

void PathTracer::light(std::span<const SurfaceParts::Point> places, std::uint32_t key,
                       std::uint32_t first, std::span<VirtualLights::Light> lights,
                       RayCounts& counts) const {
  const FlushDenormals flush;
  std::vector<Path> paths;
  paths.reserve(kBatch);
  Batch v;
  v.own_bsdfs.reserve(kBatch);
  for (std::size_t begin = 0; begin < places.size(); begin += kBatch) {
    paths.clear();
    v.own_bsdfs.clear();
    v.next_rays.count = 0;
    v.shadow_ray_count = 0;
    const std::size_t size = std::min(kBatch, places.size() - begin);
    place_on_surfaces(places.subspan(begin, size), key, first + std::uint32_t(begin), paths, v);
    std::size_t scattered = 0;
    std::array<std::size_t, kBatch> numbers;
    for (std::size_t i = 0; i < v.count; ++i) {
      // Where a pane or a cut-out lets the path through, it is lost.
      if (!evaluate_material(v, i)) continue;
      numbers[scattered] = begin + i;
      v.move(i, scattered++);
    }
    v.count = scattered;
    v.find_bases();
    draw_numbers(v);
    for (std::size_t i = 0; i < v.count; ++i) {
      const Vec3f towards = v.lights.direction.at(i);
      const bool is_lit = v.lights.density[i] > 0.0f && v.normal.at(i).dot(towards) > 0.0f &&
                          v.flat_normal.at(i).dot(towards) > 0.0f;
      if (!is_lit || v.bsdf[i]->lobes.glass > 0.0f) continue;
      v.bounce[i] = 0;
      v.light_share.set(i, Vec3f::Constant(v.weight_of_light(i, false, 0.0f)));
      v.light_reach[i] = Vertices::reach(v.lights.distance[i]);
      v.light_origin.set(i, v.leave(i, towards));
      v.shadow_rays[v.shadow_ray_count++] = std::uint8_t(i);
    }
    trace_shadow_rays<8>(v);
    for (std::size_t i = 0; i < v.count; ++i) {
      VirtualLights::Light& light = lights[numbers[i]];
      light.irradiance = v.paths[i]->result.scattered;
      if (!(light.irradiance.maxCoeff() > 0.0f)) continue;
      light.position = places[numbers[i]].position;
      light.flat_normal = places[numbers[i]].normal;
      light.normal = v.normal.at(i);
      light.to_light = v.lights.direction.at(i);
      // Where the sun shines, paths that are reused are better alone.
      const LightPlace place = v.lights.place(i);
      light.is_by_small_light = settings_.reuses_paths ? scene_.lights().is_lamp(place)
                                                       : scene_.lights().is_small_light(place);
      light.bsdf = *v.bsdf[i];
    }
  }
  counts += v.counts;
}

}  // namespace diorama
