// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "diorama/image.h"
#include "film.h"
#include "trace_job.h"

namespace diorama {

/// Decides how many light paths the pixels of a picture get, round by round: all the same, or more
/// where the noise is, until an error target is met or the time is up. Decisions are made for
/// blocks of pixels between rounds, so they do not depend on threads, and one pixel's own luck
/// hardly counts: the means stay unbiased.
class SamplePlan {
 public:
  struct Limits {
    int samples = 1;             ///< Per pixel, at most.
    double error_target = 0.0;   ///< Wanted standard error of a pixel over its brightness; 0: none.
    double time_budget_s = 0.0;  ///< Wall time after which no further round begins; 0: none.
    int block_width = 8;         ///< Pixels that get as many, and are traced together.
    int block_height = 8;
  };
  SamplePlan(int width, int height, const Limits& limits, std::uint64_t seed);

  /// Whether the first round takes all samples.
  bool has_one_round() const {
    return limits_.error_target <= 0.0 && limits_.time_budget_s <= 0.0 &&
           most_per_round_ >= std::uint32_t(limits_.samples);
  }
  std::uint64_t seed() const { return seed_; }
  /// Of all its jobs but those to learn from.
  SampleOrder order() const { return {seed_, std::uint32_t(limits_.samples)}; }
  /// Paths of a sequence of their own for a RadianceCache to learn from: one for eight of
  /// the picture; one per pixel of small pictures, and less where the picture is large.
  std::vector<TraceJob> learning_jobs() const;
  /// How many paths that are at most, of pictures of so many pixels and samples.
  static std::uint64_t most_learning_paths(std::uint64_t pixels, int samples);
  /// What to trace next; empty: the picture is done. `sums` hold all earlier rounds, which took
  /// `elapsed_s` together.
  std::vector<TraceJob> next_round(const Image<PixelSum>& sums, double elapsed_s);
  /// No round takes more samples of a pixel from now on.
  void limit_rounds(std::uint32_t samples) { most_per_round_ = samples; }
  std::uint64_t pixel_count() const;
  /// Of the whole picture, at most.
  std::uint64_t path_count() const { return pixel_count() * std::uint64_t(limits_.samples); }

 private:
  static constexpr int kFirstSamples = 16;  // Before an error is believed.

  struct Block {
    TraceJob job;  ///< sample_end: samples taken.
    std::uint32_t wanted = 0;
  };

  void want_by_error(const Image<PixelSum>& sums);
  void keep_to_time(double elapsed_s);
  /// Root mean square of the pixels' standard errors, each relative to its brightness.
  static double error_of(const Block& block, const Image<PixelSum>& sums, double faint);

  Limits limits_;
  std::uint64_t seed_;
  std::vector<Block> blocks_;
  std::uint32_t most_per_round_ = 0xFFFFFFFFu;
  double paths_ = 0.0;  ///< Planned so far.
};

}  // namespace diorama
