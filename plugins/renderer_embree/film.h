// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "diorama/image.h"
#include "path_tracer.h"

namespace diorama {

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
  void add(const PathSample& sample);
  FilmPixel mean() const;

 private:
  FilmPixel sum_;
  double luminance_ = 0.0;
  double luminance2_ = 0.0;
  int count_ = 0;
  int surfaces_ = 0;
};

}  // namespace diorama
