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

/// Rays of jobs that run side by side.
class RayTotals {
 public:
  void add(const RayCounts& counts) {
    rays_ += counts.rays;
    shadow_rays_ += counts.shadow_rays;
  }
  void add_to(EmbreeRenderer::Counts& counts) const {
    counts.rays += rays_;
    counts.shadow_rays += shadow_rays_;
  }

 private:
  std::atomic<std::uint64_t> rays_{0};
  std::atomic<std::uint64_t> shadow_rays_{0};
};

}  // namespace

Film EmbreeRenderer::trace(const View& view, const PathSettings& path_settings, SamplePlan& plan) {
  const auto start = Clock::now();
  TraceSettings settings;
  static_cast<PathSettings&>(settings) = path_settings;
  settings.host = &host();
  if (settings.starts_at_centres) settings.first_hits = &first_hits(view);
  std::optional<RadianceCache> cache;
  if (settings.ends_in_cache) {
    RayCounts rays;
    const std::vector<TraceJob> jobs = plan.learning_jobs();
    cache.emplace(PathTracer(meshes(), view, settings, isa()).learn(jobs, host(), rays));
    settings.cache = &*cache;
    for (const TraceJob& job : jobs) counts().paths += job.path_count();
    counts().rays += rays.rays;
    counts().shadow_rays += rays.shadow_rays;
  }
  const PathTracer tracer(meshes(), view, settings, isa());
  const int width = view.camera().width;
  const int height = view.camera().height;
  return plan.has_one_round() ? trace_at_once(tracer, plan, width, height)
                              : trace_in_rounds(tracer, plan, width, height, start);
}

/// Without a picture of sums, which are larger than what is left of them.
Film EmbreeRenderer::trace_at_once(const PathTracer& tracer, SamplePlan& plan, int width,
                                   int height) {
  Film film(width, height);
  RayTotals totals;
  const std::vector<TraceJob> jobs = plan.next_round({}, 0.0);
  host().parallel_for(jobs.size(), [&](std::size_t i) {
    const TraceJob& job = jobs[i];
    const int columns = job.x_end - job.x_begin;
    std::vector<PixelSum> sums(job.pixel_count());
    totals.add(tracer.trace(job, sums.data(), std::size_t(columns)));
    const PixelSum* sum = sums.data();
    for (int y = job.y_begin; y < job.y_end; ++y) {
      for (int x = job.x_begin; x < job.x_end; ++x) film.at(x, y) = (sum++)->mean();
    }
  });
  for (const TraceJob& job : jobs) counts().paths += job.path_count();
  totals.add_to(counts());
  return film;
}

Film EmbreeRenderer::trace_in_rounds(const PathTracer& tracer, SamplePlan& plan, int width,
                                     int height, Clock::time_point start) {
  Image<PixelSum> sums(width, height, PixelSum{});
  RayTotals totals;
  while (true) {
    const std::vector<TraceJob> jobs = plan.next_round(sums, seconds_since(start));
    if (jobs.empty()) break;
    host().parallel_for(jobs.size(), [&](std::size_t i) {
      const TraceJob& job = jobs[i];
      totals.add(tracer.trace(job, &sums.at(job.x_begin, job.y_begin), std::size_t(width)));
    });
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
  totals.add_to(counts());
  return film;
}

}  // namespace diorama
