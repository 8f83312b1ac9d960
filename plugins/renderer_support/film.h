// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "huge_pages.h"
#include "sampling.h"

namespace diorama {

/// One light path of a pixel.
struct PathSample {
  Vec3f seen = Vec3f::Zero();       ///< Light sources seen directly or in mirrors: free of noise.
  Vec3f scattered = Vec3f::Zero();  ///< All other radiance.
  // The first surface that scatters; zero when there was none.
  Vec3f albedo = Vec3f::Zero();  ///< Share of uniform light that it returns.
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();
  bool has_surface = false;
  bool by_chance = false;  ///< Chose between ways before it, as at glass, panes and veils.
};

/// Means over the samples of one pixel, and what the denoiser steers by.
struct FilmPixel {
  Vec3f seen = Vec3f::Zero();  ///< See PathSample.
  Vec3f scattered = Vec3f::Zero();
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();  ///< Not unit length where samples differ.
  Vec3f position = Vec3f::Zero();
  float variance = 0.0f;       ///< Of the mean of scattered's luminance.
  float brightest = 0.0f;      ///< Luminance of the brightest sample's scattered ...
  float count = 0.0f;          ///< ... among so many.
  float surface_share = 0.0f;  ///< Of the samples that met a scattering surface.
  float chance_share = 0.0f;   ///< Of the samples by chance; see PathSample.
};

/// The pixels of a picture, row by row.
class Film {
 public:
  Film() = default;
  /// Without values as yet: to write them once, in parallel, is a good part of what a film costs.
  Film(int width, int height)
      : width_(width), height_(height), pixels_(std::size_t(width) * std::size_t(height)) {}
  Film(int width, int height, const FilmPixel& fill) : Film(width, height) {
    std::ranges::fill(pixels(), fill);
  }

  int width() const { return width_; }
  int height() const { return height_; }
  FilmPixel& at(int x, int y) { return pixels()[offset(x, y)]; }
  const FilmPixel& at(int x, int y) const { return pixels()[offset(x, y)]; }
  std::span<FilmPixel> pixels() { return {pixels_.data(), pixels_.size()}; }
  std::span<const FilmPixel> pixels() const { return {pixels_.data(), pixels_.size()}; }

 private:
  std::size_t offset(int x, int y) const {
    return std::size_t(y) * std::size_t(width_) + std::size_t(x);
  }
  int width_ = 0;
  int height_ = 0;
  HugePages<FilmPixel> pixels_;
};

/// Gathers the samples of one pixel.
class PixelSum {
 public:
  void add(const PathSample& sample) {
    ++count_;
    sum_.seen += sample.seen;
    sum_.scattered += sample.scattered;
    const double l = double(luminance(sample.scattered));
    luminance_ += l;
    luminance2_ += l * l;
    brightest_ = std::max(brightest_, l);
    chances_ += sample.by_chance ? 1 : 0;
    if (!sample.has_surface) return;
    ++surfaces_;
    sum_.albedo += sample.albedo;
    sum_.normal += sample.normal;
    sum_.position += sample.position;
  }
  /// Sums that were made elsewhere: `sum` over all samples, those of the surface over the samples
  /// that met one; of what was scattered the sums of luminances and their squares.
  static PixelSum of(const FilmPixel& sum, double luminance, double luminance2, int count,
                     int surfaces, int chances) {
    PixelSum result;
    result.sum_ = sum;
    result.luminance_ = luminance;
    result.luminance2_ = luminance2;
    result.brightest_ = double(sum.brightest);
    result.count_ = count;
    result.surfaces_ = surfaces;
    result.chances_ = chances;
    return result;
  }
  FilmPixel mean() const;
  int count() const { return count_; }

 private:
  FilmPixel sum_;
  double luminance_ = 0.0;
  double luminance2_ = 0.0;
  double brightest_ = 0.0;
  int count_ = 0;
  int surfaces_ = 0;
  int chances_ = 0;
};

}  // namespace diorama
