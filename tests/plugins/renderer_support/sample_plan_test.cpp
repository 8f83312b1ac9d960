// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/sample_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"

namespace diorama {
namespace {

/// A picture whose left half is noisy and whose right half is flat; the mean is 2 everywhere.
float sample_at(int x, Rng& rng) {
  const double spread = x < 32 ? 1.0 : 0.05;
  return float(2.0 + spread * rng.uniform(-1.0, 1.0));
}

constexpr int kPlanWidth = 64;
constexpr int kPlanHeight = 40;
constexpr double kNoisySpread =
    0.57735;  // standard deviation of the uniform distribution on [-1, 1]

struct Outcome {
  Image<PixelSum> sums{kPlanWidth, kPlanHeight, PixelSum{}};
  int rounds = 0;
};

Outcome carry_out(const SamplePlan::Limits& limits, double seconds_per_round = 0.0) {
  Outcome outcome;
  SamplePlan plan(kPlanWidth, kPlanHeight, limits, 5);
  Rng rng(17);
  while (true) {
    const auto jobs = plan.next_round(outcome.sums, outcome.rounds * seconds_per_round);
    if (jobs.empty()) return outcome;
    ++outcome.rounds;
    REQUIRE(outcome.rounds < 100);
    for (const TraceJob& job : jobs) {
      for (int y = job.y_begin; y < job.y_end; ++y) {
        for (int x = job.x_begin; x < job.x_end; ++x) {
          PixelSum& sum = outcome.sums.at(x, y);
          REQUIRE(std::uint32_t(sum.count()) == job.sample_begin);
          for (std::uint32_t s = job.sample_begin; s < job.sample_end; ++s) {
            PathSample sample;
            sample.scattered = Vec3f::Constant(sample_at(x, rng));
            sample.has_surface = true;
            sum.add(sample);
          }
        }
      }
    }
  }
}

std::uint64_t path_count(const std::vector<TraceJob>& jobs) {
  std::uint64_t paths = 0;
  for (const TraceJob& job : jobs) paths += job.path_count();
  return paths;
}

constexpr std::uint64_t kManyPaths = 1u << 20;  // what a cache learns from in large pictures

}  // namespace

TEST_CASE("without target and budget every pixel gets its samples at once", "[sample_plan]") {
  const Outcome outcome = carry_out({24, 0.0, 0.0});
  CHECK(outcome.rounds == 1);
  for (const PixelSum& sum : outcome.sums.pixels()) CHECK(sum.count() == 24);
}

TEST_CASE("an error target is met with few samples where the picture is flat", "[sample_plan]") {
  constexpr double kTarget = 0.02;
  const Outcome outcome = carry_out({4096, kTarget, 0.0});
  double squares = 0.0;
  double mean = 0.0;
  for (int y = 0; y < kPlanHeight; ++y) {
    for (int x = 0; x < kPlanWidth; ++x) {
      const PixelSum& sum = outcome.sums.at(x, y);
      if (x >= 32) {
        CHECK(sum.count() == 16);
        continue;
      }
      // As many as the law of large numbers asks for, but for the estimate's error and the steps.
      const double needed = std::pow(kNoisySpread / (2.0 * kTarget), 2);
      CHECK(sum.count() > 0.75 * needed);
      CHECK(sum.count() < 1.6 * needed);
      const double value = double(luminance(sum.mean().scattered));
      squares += std::pow(value / 2.0 - 1.0, 2) / (32 * kPlanHeight);
      mean += value / (32 * kPlanHeight);
    }
  }
  CHECK(std::sqrt(squares) < 1.1 * kTarget);
  // Stopping by the error does not shift the mean: four standard errors of it.
  CHECK(std::abs(mean - 2.0) < 4.0 * 2.0 * kTarget / std::sqrt(32.0 * kPlanHeight));
}

TEST_CASE("an error target ends at the most samples", "[sample_plan]") {
  const Outcome outcome = carry_out({40, 1e-6, 0.0});
  for (const PixelSum& sum : outcome.sums.pixels()) CHECK(sum.count() == 40);
}

TEST_CASE("pixels of a black picture are done after the first round", "[sample_plan]") {
  SamplePlan plan(16, 8, {100, 0.01, 0.0}, 1);
  Image<PixelSum> sums(16, 8, PixelSum{});
  REQUIRE(plan.next_round(sums, 0.0).size() == 2);
  for (PixelSum& sum : sums.pixels()) {
    for (int i = 0; i < 16; ++i) sum.add({});
  }
  CHECK(plan.next_round(sums, 0.0).empty());
}

TEST_CASE("a time budget ends the sampling, however slow the machine", "[sample_plan]") {
  // Every round is said to take a second, so the plan shrinks its rounds.
  const Outcome slow = carry_out({1000, 0.0, 2.5}, 1.0);
  CHECK(slow.rounds == 2);
  for (const PixelSum& sum : slow.sums.pixels()) CHECK(sum.count() >= 1);
  const Outcome late = carry_out({1000, 0.0, 0.5}, 1.0);
  CHECK(late.rounds == 1);
  // Time enough: all samples are taken, in rounds that double.
  const Outcome fast = carry_out({100, 0.0, 1e6}, 1e-3);
  CHECK(fast.rounds < 12);
  for (const PixelSum& sum : fast.sums.pixels()) CHECK(sum.count() == 100);
}

TEST_CASE("a cache learns from one path for eight of a small picture", "[sample_plan]") {
  constexpr int kWidth = 67;
  constexpr int kHeight = 35;
  using Samples = std::pair<int, std::uint32_t>;  // of the picture, and to learn from
  for (const auto& [samples, expected] :
       {Samples{1, 1}, Samples{4, 1}, Samples{16, 2}, Samples{40, 5}}) {
    CAPTURE(samples);
    SamplePlan plan(kWidth, kHeight, {samples}, 9);
    const SampleOrder own = plan.next_round({}, 0.0).at(0).order;
    Image<int> covered(kWidth, kHeight, 0);
    for (const TraceJob& job : plan.learning_jobs()) {
      CHECK(job.sample_begin == 0);
      CHECK(job.sample_end == expected);
      for (int y = job.y_begin; y < job.y_end; ++y) {
        for (int x = job.x_begin; x < job.x_end; ++x) {
          ++covered.at(x, y);
          // Else paths would find again what they found themselves.
          REQUIRE(job.order.place(x, y, 0).key != own.place(x, y, 0).key);
        }
      }
    }
    CHECK(std::ranges::all_of(covered.pixels(), [](int count) { return count == 1; }));
  }
}

TEST_CASE("of a large picture a cache learns from blocks all over it", "[sample_plan]") {
  constexpr int kWidth = 4096;
  constexpr int kHeight = 2160;
  for (const int samples : {1, 64}) {
    const SamplePlan plan(kWidth, kHeight, {samples}, 3);
    const std::vector<TraceJob> jobs = plan.learning_jobs();
    const std::uint64_t paths = path_count(jobs);
    CAPTURE(samples, paths);
    CHECK(paths <= SamplePlan::most_learning_paths(kWidth * kHeight, samples));
    CHECK(paths >= kManyPaths / 4);
    std::array<int, 4> quarters{};
    for (const TraceJob& job : jobs) {
      const int row = 2 * job.y_begin / kHeight;
      ++quarters[std::size_t(2 * row + 2 * job.x_begin / kWidth)];
    }
    for (const int blocks : quarters) {
      CHECK(blocks > 0.15 * double(jobs.size()));
      CHECK(blocks < 0.35 * double(jobs.size()));
    }
  }
}

TEST_CASE("a cache never learns from more paths than its memory was counted for", "[sample_plan]") {
  // Among them pictures next to where one more sample, or all blocks, would be too many.
  using Size = std::array<int, 2>;
  for (const auto& [width, height] :
       {Size{8, 8}, Size{67, 35}, Size{640, 480}, Size{1024, 1024}, Size{1025, 1024},
        Size{1920, 1080}, Size{2056, 1024}, Size{8000, 6000}}) {
    for (const int samples : {1, 16, 1 << 20}) {
      const SamplePlan plan(width, height, {samples}, 5);
      const auto pixels = std::uint64_t(width) * std::uint64_t(height);
      const std::uint64_t most = SamplePlan::most_learning_paths(pixels, samples);
      CAPTURE(width, height, samples, most);
      CHECK(path_count(plan.learning_jobs()) <= most);
      CHECK(most <= 2 * kManyPaths);
    }
  }
}

}  // namespace diorama
