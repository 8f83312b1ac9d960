// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "diorama/host.h"
#include "film.h"
#include "radiance_cache.h"
#include "trace_job.h"

namespace diorama {

/// Paths that find what a RadianceCache is made from. Each is a sample of its pixel as well: once
/// the cache is known, it ends there as all others do (ADR 0099).
class LearningPaths {
 public:
  struct Path {
    int x = 0;  ///< Pixel of the picture.
    int y = 0;
    bool has_finding = false;
    float clamp = 0.0f;      ///< Luminance that light from the cache has at most; 0: any.
    PathSample sample = {};  ///< Without what it found from its finding on.
  };
  /// Of one job.
  class Part {
   public:
    void reserve(std::size_t paths);
    /// `finding` counts where the path has one.
    void add(const Path& path, const RadianceCache::Finding& finding);

   private:
    friend class LearningPaths;
    std::vector<Path> paths_;
    std::vector<RadianceCache::Finding> findings_;
  };

  /// Memory that a path takes at most, with making the cache but without its table.
  static constexpr std::size_t kBytes = 352;

  LearningPaths() = default;
  explicit LearningPaths(std::size_t parts) : parts_(parts) {}
  Part& part(std::size_t number) { return parts_[number]; }

  RadianceCache cache(const Vec3f& eye) const;
  /// Completes the samples: with light of the cache where that knows a path's place, else with what
  /// the path has found itself. Once.
  void end_in(const RadianceCache& cache, Host& host);

  /// Of each job those paths that lie in it. Both have come from one SamplePlan, whose blocks are
  /// in the same order.
  std::vector<std::span<const Path>> of(std::span<const TraceJob> jobs) const;
  /// Calls `take` with each, in the order in which they were added to their parts.
  template <class Take>
  void for_each(Take&& take) const {
    for (const Part& part : parts_) {
      for (const Path& path : part.paths_) take(path);
    }
  }

 private:
  std::vector<Part> parts_;
};

}  // namespace diorama
