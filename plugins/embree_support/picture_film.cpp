// SPDX-License-Identifier: Apache-2.0
#include "picture_film.h"

#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "virtual_light_tracer.h"

namespace diorama {
namespace {

using Clock = std::chrono::steady_clock;

void count(const std::vector<TraceJob>& jobs, PictureCounts& counts) {
  for (const TraceJob& job : jobs) counts.paths += job.path_count();
}

/// `sets`: null where there are no virtual lights.
Film film_in_rounds(const PathTracer& tracer, const View& view, SamplePlan& plan,
                    VirtualLightSets* sets, const LearningPaths& learning, Clock::time_point start,
                    Host& host, PictureCounts& counts) {
  const int width = view.camera().width;
  const int height = view.camera().height;
  Image<PixelSum> sums(width, height, PixelSum{});
  learning.for_each(
      [&](const LearningPaths::Path& path) { sums.at(path.x, path.y).add(path.sample); });
  for (bool is_first = true;; is_first = false) {
    const double elapsed = std::chrono::duration<double>(Clock::now() - start).count();
    const std::vector<TraceJob> jobs = plan.next_round(sums, elapsed);
    if (jobs.empty()) break;
    if (sets && !is_first) sets->renew(jobs, counts.rays);
    std::vector<RayCounts> own(jobs.size());
    host.parallel_for(jobs.size(), [&](std::size_t i) {
      const TraceJob& job = jobs[i];
      own[i] = tracer.trace(job, &sums.at(job.x_begin, job.y_begin), std::size_t(width));
    });
    for (const RayCounts& counted : own) counts.rays += counted;
    count(jobs, counts);
  }
  Film film(width, height);
  host.parallel_for(std::size_t(height), [&](std::size_t row) {
    for (int x = 0; x < width; ++x) {
      const Pixel pixel = tracer.place(plan.order(), x, int(row));
      film.at(pixel.x, pixel.y) = sums.at(x, int(row)).mean();
    }
  });
  return film;
}

}  // namespace

Film picture_film(const EmbreeScene& scene, const View& view, TraceSettings settings, Isa isa,
                  SamplePlan& plan, Host& host, PictureCounts& counts) {
  const auto start = Clock::now();
  settings.host = &host;
  const std::unique_ptr<VirtualLightSets> sets =
      VirtualLightSets::for_picture(scene, view, settings, isa, plan, host, counts.rays);
  if (sets) settings.virtual_lights = &sets->lights();
  std::optional<RadianceCache> cache;
  LearningPaths learning;
  if (settings.ends_in_cache) {
    const std::vector<TraceJob> jobs = plan.learning_jobs();
    learning = PathTracer(scene, view, settings, isa).learn(jobs, host, counts.rays);
    cache.emplace(learning.cache(view.position()));
    learning.end_in(*cache, host);
    settings.cache = &*cache;
    count(jobs, counts);
  }
  const PathTracer tracer(scene, view, settings, isa);
  if (!plan.has_one_round()) {
    return film_in_rounds(tracer, view, plan, sets.get(), learning, start, host, counts);
  }
  const std::vector<TraceJob> jobs = plan.next_round({}, 0.0);
  count(jobs, counts);
  return tracer.film(jobs, host, counts.rays, learning);
}

}  // namespace diorama
