// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "diorama/image.h"
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
};

/// Means over the samples of one pixel, and what the denoiser steers by.
struct FilmPixel {
  Vec3f seen = Vec3f::Zero();  ///< See PathSample.
  Vec3f scattered = Vec3f::Zero();
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();  ///< Not unit length where samples differ.
  Vec3f position = Vec3f::Zero();
  float variance = 0.0f;       ///< Of the mean of scattered's luminance.
  float surface_share = 0.0f;  ///< Of the samples that met a scattering surface.
};

using Film = Image<FilmPixel>;

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
    if (!sample.has_surface) return;
    ++surfaces_;
    sum_.albedo += sample.albedo;
    sum_.normal += sample.normal;
    sum_.position += sample.position;
  }
  FilmPixel mean() const;
  int count() const { return count_; }

 private:
  FilmPixel sum_;
  double luminance_ = 0.0;
  double luminance2_ = 0.0;
  int count_ = 0;
  int surfaces_ = 0;
};

}  // namespace diorama
