// SPDX-License-Identifier: Apache-2.0
#include "sample_plan.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

/// Pixels darker than this share of the picture's typical brightness count as that bright.
constexpr double kFaint = 0.1;

double brightness(const FilmPixel& pixel) {
  return double(luminance(pixel.seen) + luminance(pixel.scattered));
}

/// Typical, not mean: a lamp in the picture hardly counts.
double typical_brightness(const Image<PixelSum>& sums) {
  double roots = 0.0;
  for (const PixelSum& sum : sums.pixels()) {
    roots += std::sqrt(std::max(0.0, brightness(sum.mean())));
  }
  const double mean = roots / double(sums.pixels().size());
  return mean * mean;
}

// Twice as many paths that learn take a tenth more time for half a percent less error (measured);
// so few cells are known to fewer of them than the second number that pictures get worse.
constexpr std::uint64_t kPathsForOne = 8;
constexpr std::uint64_t kFewLearningPaths = 1u << 17;
constexpr std::uint64_t kMostLearningPaths = 1u << 19;

std::uint64_t learning_paths(std::uint64_t pixels, int samples) {
  return std::clamp(pixels * std::uint64_t(samples) / kPathsForOne,
                    std::min(pixels, kFewLearningPaths), kMostLearningPaths);
}

/// Per pixel of those that have any.
std::uint32_t learning_samples(std::uint64_t pixels, int samples) {
  return std::uint32_t(std::max<std::uint64_t>(
      1, learning_paths(pixels, samples) / std::max<std::uint64_t>(1, pixels)));
}

}  // namespace

SamplePlan::SamplePlan(int width, int height, const Limits& limits, std::uint64_t seed)
    : limits_(limits), seed_(seed) {
  for (int y = 0; y < height; y += limits.block_height) {
    for (int x = 0; x < width; x += limits.block_width) {
      const int x_end = std::min(width, x + limits.block_width);
      const int y_end = std::min(height, y + limits.block_height);
      blocks_.push_back({{x, y, x_end, y_end, 0, 0, order()}, 0});
    }
  }
}

std::uint64_t SamplePlan::pixel_count() const {
  std::uint64_t pixels = 0;
  for (const Block& block : blocks_) pixels += block.job.pixel_count();
  return pixels;
}

std::vector<TraceJob> SamplePlan::learning_jobs() const {
  const std::uint64_t pixels = pixel_count();
  const std::uint32_t samples = learning_samples(pixels, limits_.samples);
  // One block of so many, anywhere.
  const std::uint64_t share = pixels / std::min(pixels, learning_paths(pixels, limits_.samples));
  const std::uint64_t own_seed = mix_bits(seed_ ^ 0x4C4541524E494E47u);
  const SampleOrder order(own_seed, samples);
  std::vector<TraceJob> jobs;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (mix_bits(own_seed ^ i) % share != 0) continue;
    TraceJob& job = jobs.emplace_back(blocks_[i].job);
    job.sample_begin = 0;
    job.sample_end = samples;
    job.order = order;
  }
  return jobs;
}

std::uint64_t SamplePlan::most_learning_paths(std::uint64_t pixels, int samples) {
  // Blocks are chosen by chance: a few more than meant may be.
  return std::min(pixels * learning_samples(pixels, samples), 2 * kMostLearningPaths);
}

std::vector<TraceJob> SamplePlan::next_round(const Image<PixelSum>& sums, double elapsed_s) {
  const auto most = std::uint32_t(limits_.samples);
  if (limits_.error_target > 0.0) {
    want_by_error(sums);
  } else {
    for (Block& block : blocks_) block.wanted = most;
  }
  if (limits_.time_budget_s > 0.0) keep_to_time(elapsed_s);
  std::vector<TraceJob> jobs;
  for (Block& block : blocks_) {
    std::uint32_t wanted = std::min(block.wanted, most);
    if (wanted <= block.job.sample_end) continue;
    wanted = block.job.sample_end + std::min(wanted - block.job.sample_end, most_per_round_);
    block.job.sample_begin = block.job.sample_end;
    block.job.sample_end = wanted;
    paths_ += double(block.job.path_count());
    jobs.push_back(block.job);
  }
  return jobs;
}

void SamplePlan::want_by_error(const Image<PixelSum>& sums) {
  const double faint = paths_ > 0.0 ? kFaint * typical_brightness(sums) : 0.0;
  for (Block& block : blocks_) {
    const std::uint32_t taken = block.job.sample_end;
    if (taken < kFirstSamples) {
      block.wanted = kFirstSamples;
      continue;
    }
    const double ratio = error_of(block, sums, faint) / limits_.error_target;
    // The estimate is rough: a long way is gone in steps.
    const double factor = ratio > 1.0 ? std::clamp(ratio * ratio, 1.25, 2.0) : 0.0;
    block.wanted = std::uint32_t(std::ceil(factor * taken));
  }
}

// The first samples tell how long a path takes; after that a round may double what was done.
void SamplePlan::keep_to_time(double elapsed_s) {
  double pixels = 0.0;
  double asked = 0.0;
  for (const Block& block : blocks_) {
    const std::uint32_t taken = block.job.sample_end;
    pixels += block.job.pixel_count();
    if (block.wanted > taken)
      asked += double(block.job.pixel_count()) * double(block.wanted - taken);
  }
  double affordable = pixels;
  if (paths_ > 0.0) {
    const double left = std::max(0.0, limits_.time_budget_s - elapsed_s);
    affordable = std::min(paths_, paths_ * left / std::max(elapsed_s, 1e-9));
  }
  const double share = asked > affordable ? affordable / asked : 1.0;
  for (Block& block : blocks_) {
    const std::uint32_t taken = block.job.sample_end;
    if (block.wanted > taken) {
      block.wanted = taken + std::uint32_t(share * double(block.wanted - taken) + 1e-6);
    }
  }
}

double SamplePlan::error_of(const Block& block, const Image<PixelSum>& sums, double faint) {
  double sum = 0.0;
  for (int y = block.job.y_begin; y < block.job.y_end; ++y) {
    for (int x = block.job.x_begin; x < block.job.x_end; ++x) {
      const FilmPixel pixel = sums.at(x, y).mean();
      const double scale = std::max(brightness(pixel), faint);
      if (scale > 0.0) sum += double(pixel.variance) / (scale * scale);
    }
  }
  return std::sqrt(sum / double(block.job.pixel_count()));
}

}  // namespace diorama
