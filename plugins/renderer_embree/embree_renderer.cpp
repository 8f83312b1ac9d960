// SPDX-License-Identifier: Apache-2.0
#include "embree_renderer.h"

#include <atomic>
#include <chrono>
#include <optional>
#include <vector>

namespace diorama {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

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
    film = tracer.film(jobs, host(), rays);
    count(jobs);
  } else {
    film = trace_in_rounds(tracer, plan, view.camera().width, view.camera().height, start, rays);
  }
  counts().rays = rays.rays;
  counts().shadow_rays = rays.shadow_rays;
  return film;
}

Film EmbreeRenderer::trace_in_rounds(const PathTracer& tracer, SamplePlan& plan, int width,
                                     int height, Clock::time_point start, RayCounts& rays) {
  Image<PixelSum> sums(width, height, PixelSum{});
  while (true) {
    const std::vector<TraceJob> jobs = plan.next_round(sums, seconds_since(start));
    if (jobs.empty()) break;
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
