// SPDX-License-Identifier: Apache-2.0
#include "film.h"

namespace diorama {

FilmPixel PixelSum::mean() const {
  FilmPixel pixel;
  if (count_ == 0) return pixel;
  if (count_ == 1) {
    // Its own mean; it says nothing of its spread: take the value itself.
    pixel = sum_;
    pixel.variance = float(luminance_ * luminance_);
    pixel.brightest = float(brightest_);
    pixel.count = 1.0f;
    pixel.surface_share = float(surfaces_);
    pixel.chance_share = float(chances_);
    return pixel;
  }
  const float scale = 1.0f / float(count_);
  pixel.seen = sum_.seen * scale;
  pixel.scattered = sum_.scattered * scale;
  pixel.surface_share = float(surfaces_) * scale;
  pixel.chance_share = float(chances_) * scale;
  if (surfaces_ > 0) {
    const float per_surface = 1.0f / float(surfaces_);
    // Spread over all samples: an edge pixel reflects only where it has a surface.
    pixel.albedo = sum_.albedo * scale;
    pixel.normal = sum_.normal * per_surface;
    pixel.position = sum_.position * per_surface;
  }
  const double mean = luminance_ / count_;
  const double spread = std::max(0.0, luminance2_ / count_ - mean * mean);
  pixel.variance = float(spread / (count_ - 1));
  pixel.brightest = float(brightest_);
  pixel.count = float(count_);
  return pixel;
}

}  // namespace diorama
