// SPDX-License-Identifier: Apache-2.0
#include "embree_renderer.h"

#include <pmmintrin.h>
#include <xmmintrin.h>

#include <atomic>
#include <chrono>
#include <vector>

namespace diorama {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

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

/// Rays of jobs that run side by side.
class RayTotals {
 public:
  void add(const RayCounts& counts) {
    rays_ += counts.rays;
    shadow_rays_ += counts.shadow_rays;
  }
  void put_into(EmbreeRenderer::Counts& counts) const {
    counts.rays = rays_;
    counts.shadow_rays = shadow_rays_;
  }

 private:
  std::atomic<std::uint64_t> rays_{0};
  std::atomic<std::uint64_t> shadow_rays_{0};
};

}  // namespace

Film EmbreeRenderer::trace(const View& view, const PathSettings& path_settings, SamplePlan& plan) {
  TraceSettings settings;
  static_cast<PathSettings&>(settings) = path_settings;
  settings.host = &host();
  if (settings.starts_at_centres) settings.first_hits = &first_hits(view);
  const PathTracer tracer(meshes(), view, settings, isa());
  const int width = view.camera().width;
  const int height = view.camera().height;
  return plan.has_one_round() ? trace_at_once(tracer, plan, width, height)
                              : trace_in_rounds(tracer, plan, width, height);
}

/// Without a picture of sums, which are larger than what is left of them.
Film EmbreeRenderer::trace_at_once(const PathTracer& tracer, SamplePlan& plan, int width,
                                   int height) {
  Film film(width, height);
  RayTotals totals;
  const std::vector<TraceJob> jobs = plan.next_round({}, 0.0);
  host().parallel_for(jobs.size(), [&](std::size_t i) {
    const FlushDenormals flush;
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
  totals.put_into(counts());
  return film;
}

Film EmbreeRenderer::trace_in_rounds(const PathTracer& tracer, SamplePlan& plan, int width,
                                     int height) {
  Image<PixelSum> sums(width, height, PixelSum{});
  RayTotals totals;
  const auto start = Clock::now();
  while (true) {
    const std::vector<TraceJob> jobs = plan.next_round(sums, seconds_since(start));
    if (jobs.empty()) break;
    host().parallel_for(jobs.size(), [&](std::size_t i) {
      const FlushDenormals flush;
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
  counts().paths = paths;
  totals.put_into(counts());
  return film;
}

}  // namespace diorama
