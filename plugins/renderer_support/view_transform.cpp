// SPDX-License-Identifier: Apache-2.0
#include "view_transform.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sampling.h"
#include "srgb_bytes.h"

namespace diorama {
namespace {

/// A curve per channel pulls colours apart; this much of the grey goes back in before.
constexpr float kFilmicGrey = 0.15f;

/// At least so many tell the exposure of pictures that have them.
constexpr double kExposurePixels = 1 << 16;

/// Narkowicz, "ACES filmic tone mapping curve", 2015. White long before the squares overflow.
float filmic(float x) {
  x = std::min(x, 1e6f);
  return std::clamp(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 0.0f, 1.0f);
}

/// By the luminance of the pixels.
template <class LuminanceAt>
double exposure_of(int width, int height, const LuminanceAt& luminance_at) {
  constexpr double kMiddleGrey = 0.18;
  // What the middle tones of a dark picture ask for burns all else in it. Brighter by more than
  // this are windows and lamps, whatever they take of the picture: what they light is to be seen.
  constexpr double kWhite = 1.0;
  constexpr double kMostDarker = 3.0;
  // Of large pictures every so many pixels will do.
  const double share = double(width) * double(height) / kExposurePixels;
  const int step = std::max(1, int(std::sqrt(share)));
  std::vector<float> lit;
  for (int y = 0; y < height; y += step) {
    for (int x = 0; x < width; x += step) {
      const float l = luminance_at(x, y);
      if (l > 0.0f && std::isfinite(l)) lit.push_back(l);
    }
  }
  if (lit.empty()) return 1.0;
  // The middle four fifths. Selection is much cheaper than sorting.
  const auto tenth = std::ptrdiff_t(lit.size() / 10);
  const auto begin = lit.begin() + tenth;
  const auto end = std::max(begin + 1, lit.end() - tenth);
  std::nth_element(lit.begin(), begin, lit.end());
  if (end != lit.end()) std::nth_element(begin, end, lit.end());
  double sum = 0.0;
  for (auto it = begin; it != end; ++it) sum += std::log(double(*it));
  double exposure = kMiddleGrey / std::exp(sum / double(end - begin));
  if (end != lit.end()) {
    exposure /= std::clamp(exposure * double(*end) / kWhite, 1.0, kMostDarker);
  }
  return std::clamp(exposure, 1e-8, 1e8);
}

}  // namespace

double automatic_exposure(const Image<Vec3f>& hdr) {
  return exposure_of(hdr.width(), hdr.height(),
                     [&](int x, int y) { return luminance(hdr.at(x, y)); });
}

double automatic_exposure(const Film& film) {
  return exposure_of(film.width(), film.height(), [&](int x, int y) {
    return luminance(film.at(x, y).seen + film.at(x, y).scattered);
  });
}

Image<Rgba8> displayed(const Image<Vec3f>& hdr, double exposure, ViewTransform transform,
                       Host& host) {
  static const SrgbBytes bytes;
  const bool is_filmic = transform == ViewTransform::Filmic;
  Image<Rgba8> image(hdr.width(), hdr.height(), Rgba8{0, 0, 0, 255});
  host.parallel_for(std::size_t(hdr.height()), [&](std::size_t row) {
    // Step by step for the whole row, because compilers make vectors of each step.
    std::vector<float> values(3 * std::size_t(hdr.width()));
    float* value = values.data();
    for (const Vec3f& pixel : hdr.row(int(row))) {
      const Vec3f exposed = pixel * float(exposure);
      const float grey = is_filmic ? kFilmicGrey * luminance(exposed) : 0.0f;
      const float own = is_filmic ? 1.0f - kFilmicGrey : 1.0f;
      for (int k = 0; k < 3; ++k) *value++ = grey + own * exposed[k];
    }
    if (is_filmic) {
      for (float& v : values) v = filmic(v);
    }
    std::vector<std::int32_t> places(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) places[i] = SrgbBytes::place_of(values[i]);
    const std::int32_t* place = places.data();
    for (Rgba8& pixel : image.row(int(row))) {
      for (std::size_t k = 0; k < 3; ++k) pixel[k] = bytes[*place++];
    }
  });
  return image;
}

}  // namespace diorama
