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

/// Narkowicz, "ACES filmic tone mapping curve", 2015. White long before the squares overflow.
float filmic(float x) {
  x = std::min(x, 1e6f);
  return std::clamp(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 0.0f, 1.0f);
}

}  // namespace

double automatic_exposure(const Image<Vec3f>& hdr) {
  constexpr double kMiddleGrey = 0.18;
  std::vector<float> lit;
  for (const Vec3f& pixel : hdr.pixels()) {
    const float l = luminance(pixel);
    if (l > 0.0f && std::isfinite(l)) lit.push_back(l);
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
  return std::clamp(kMiddleGrey / std::exp(sum / double(end - begin)), 1e-8, 1e8);
}

Image<Rgba8> displayed(const Image<Vec3f>& hdr, double exposure, ViewTransform transform,
                       Host& host) {
  const SrgbBytes bytes;
  const bool is_filmic = transform == ViewTransform::Filmic;
  Image<Rgba8> image(hdr.width(), hdr.height(), Rgba8{0, 0, 0, 255});
  host.parallel_for(std::size_t(hdr.height()), [&](std::size_t row) {
    for (int x = 0; x < hdr.width(); ++x) {
      const Vec3f exposed = hdr.at(x, int(row)) * float(exposure);
      const float grey = kFilmicGrey * luminance(exposed);
      Rgba8& pixel = image.at(x, int(row));
      for (std::size_t k = 0; k < 3; ++k) {
        const float value = exposed[Eigen::Index(k)];
        pixel[k] = bytes(is_filmic ? filmic(grey + (1.0f - kFilmicGrey) * value) : value);
      }
    }
  });
  return image;
}

}  // namespace diorama
