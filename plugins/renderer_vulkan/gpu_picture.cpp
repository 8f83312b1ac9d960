// SPDX-License-Identifier: Apache-2.0
#include "gpu_picture.h"

#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "embree_support/virtual_light_tracer.h"

namespace diorama {

void trace_picture(GpuPathTracer& tracer, const GpuScene& scene, const EmbreeScene& meshes,
                   const View& view, const PathSettings& settings, Isa isa, SamplePlan& plan,
                   Host& host, PictureCounts& counts) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  const auto count = [&](const std::vector<TraceJob>& jobs, const GpuPathTracer::Counts& own) {
    for (const TraceJob& job : jobs) counts.paths += job.path_count();
    counts.rays += {own.rays, own.shadow_rays};
  };
  const std::unique_ptr<VirtualLightSets> sets =
      VirtualLightSets::for_picture(meshes, view, settings, isa, plan, host, counts.rays);
  tracer.begin(view, settings, scene, meshes.window());
  if (sets) tracer.connect_with(sets->lights());
  std::optional<RadianceCache> cache;
  if (settings.ends_in_cache) {
    const std::vector<TraceJob> jobs = plan.learning_jobs();
    GpuPathTracer::Counts own;
    LearningPaths learning = tracer.learn(jobs, own);
    cache.emplace(learning.cache(view.position()));
    learning.end_in(*cache, host);
    count(jobs, own);
    tracer.begin(view, settings, scene, meshes.window(), &*cache, sets != nullptr);
    tracer.count(learning);
  }
  Image<PixelSum> sums;
  for (bool is_first = true;; is_first = false) {
    const double elapsed = std::chrono::duration<double>(Clock::now() - start).count();
    const std::vector<TraceJob> jobs = plan.next_round(sums, elapsed);
    if (jobs.empty()) break;
    if (sets && !is_first) {
      sets->renew(jobs, counts.rays);
      tracer.connect_with(sets->lights());
    }
    count(jobs, tracer.trace(jobs));
    if (plan.has_one_round()) break;
    sums = tracer.sums();
  }
}

}  // namespace diorama
