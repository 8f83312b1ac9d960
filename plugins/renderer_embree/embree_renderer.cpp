// SPDX-License-Identifier: Apache-2.0
#include "embree_renderer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <optional>
#include <vector>

namespace diorama {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Of a pixel.
std::uint32_t samples_per_set(std::uint64_t pixels) {
  return std::uint32_t(std::max<std::uint64_t>(1, VirtualLightSets::kMostPaths / pixels));
}

}  // namespace

std::size_t EmbreeRenderer::traced_bytes(std::size_t pixels) const {
  const bool has_sets = has_virtual_lights() && pixels > 0;
  const bool has_sums =
      has_rounds() || (has_sets && std::uint32_t(samples()) > samples_per_set(pixels));
  return (has_sums ? pixels * sizeof(PixelSum) : 0) +
         (has_sets ? VirtualLightSets::most_bytes(meshes().instances()) : 0);
}

Film EmbreeRenderer::trace(const View& view, const PathSettings& path_settings, SamplePlan& plan) {
  const auto start = Clock::now();
  TraceSettings settings;
  static_cast<PathSettings&>(settings) = path_settings;
  settings.host = &host();
  if (settings.starts_at_centres) settings.first_hits = &first_hits(view);
  RayCounts rays;
  const auto count = [&](const std::vector<TraceJob>& jobs) {
    for (const TraceJob& job : jobs) counts().paths += job.path_count();
  };
  std::optional<VirtualLightSets> sets;
  const std::uint64_t paths = plan.path_count();
  if (settings.has_virtual_lights && !view.has_shutter() && !meshes().lights().bodies().empty() &&
      paths >= VirtualLightSets::kLeastPaths) {
    sets.emplace(meshes(), view, settings, isa(), paths, plan.seed(), host(), rays);
    if (sets->are_worth_it()) {
      settings.virtual_lights = &sets->lights();
      plan.limit_rounds(samples_per_set(plan.pixel_count()));
    } else {
      sets.reset();
    }
  }
  std::optional<RadianceCache> cache;
  if (settings.ends_in_cache) {
    const std::vector<TraceJob> jobs = plan.learning_jobs();
    cache.emplace(PathTracer(meshes(), view, settings, isa()).learn(jobs, host(), rays));
    settings.cache = &*cache;
    count(jobs);
  }
  const PathTracer tracer(meshes(), view, settings, isa());
  Film film;
  if (plan.has_one_round()) {
    const std::vector<TraceJob> jobs = plan.next_round({}, 0.0);
    if (sets) sets->renew(jobs, rays);
    film = tracer.film(jobs, host(), rays);
    count(jobs);
  } else {
    film = trace_in_rounds(tracer, plan, sets ? &*sets : nullptr, view.camera().width,
                           view.camera().height, start, rays);
  }
  counts().rays = rays.rays;
  counts().shadow_rays = rays.shadow_rays;
  return film;
}

Film EmbreeRenderer::trace_in_rounds(const PathTracer& tracer, SamplePlan& plan,
                                     VirtualLightSets* sets, int width, int height,
                                     Clock::time_point start, RayCounts& rays) {
  Image<PixelSum> sums(width, height, PixelSum{});
  while (true) {
    const std::vector<TraceJob> jobs = plan.next_round(sums, seconds_since(start));
    if (jobs.empty()) break;
    if (sets) sets->renew(jobs, rays);
    std::vector<RayCounts> own(jobs.size());
    host().parallel_for(jobs.size(), [&](std::size_t i) {
      const TraceJob& job = jobs[i];
      own[i] = tracer.trace(job, &sums.at(job.x_begin, job.y_begin), std::size_t(width));
    });
    for (const RayCounts& counted : own) rays += counted;
  }
  Film film(width, height);
  std::atomic<std::uint64_t> paths{0};
  host().parallel_for(std::size_t(height), [&](std::size_t row) {
    std::uint64_t count = 0;
    for (int x = 0; x < width; ++x) {
      const PixelSum& sum = sums.at(x, int(row));
      film.at(x, int(row)) = sum.mean();
      count += std::uint64_t(sum.count());
    }
    paths += count;
  });
  counts().paths += paths;
  return film;
}

}  // namespace diorama
