// SPDX-License-Identifier: Apache-2.0
#include "denoiser.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "network_filter.h"
#include "plane_filter.h"
#include "sampling.h"
#include "spare_pages.h"
#include "view_transform.h"

namespace diorama {
namespace {

constexpr double kPriorBias = 0.1;     // what a picture's mean is off by before it is set right
constexpr double kMostReturned = 2.0;  // of the light that is left
constexpr float kMostLight = 1e15f;    // beyond it there are no sums

float finite(float value) {
  return std::isfinite(value) ? std::clamp(value, -kMostLight, kMostLight) : 0.0f;
}
Vec3f finite(const Vec3f& value) {
  return value.unaryExpr([](float v) { return finite(v); });
}

/// Gives the picture the mean that it had with its noise, as far as that noise lets it be known.
/// What is seen directly stays.
void rebalance(Image<Vec3f>& image, const Film& film, Host& host) {
  struct Sums {
    double before = 0.0;
    double after = 0.0;
    double variance = 0.0;
  };
  std::vector<Sums> rows(std::size_t(image.height()));
  host.parallel_for(rows.size(), [&](std::size_t row) {
    const int y = int(row);
    Sums sums;
    for (int x = 0; x < image.width(); ++x) {
      const FilmPixel& pixel = film.at(x, y);
      const float light = finite(luminance(pixel.seen + pixel.scattered));
      const float seen = luminance(finite(pixel.seen));
      sums.before += double(light - seen);
      sums.after += double(finite(luminance(image.at(x, y))) - seen);
      // Of a single path nobody knows.
      sums.variance += double(pixel.count > 1.5f ? std::max(0.0f, finite(pixel.variance))
                                                 : finite(light * light));
    }
    rows[row] = sums;
  });
  Sums all;
  for (const Sums& row : rows) {
    all.before += row.before;
    all.after += row.after;
    all.variance += row.variance;
  }
  if (!(all.before > 0.0 && all.after > 0.0)) return;
  const double uncertain = all.variance / (all.before * all.before);
  const double trust = kPriorBias * kPriorBias / (kPriorBias * kPriorBias + uncertain);
  const double wanted = std::clamp(all.before / all.after, 1.0 / kMostReturned, kMostReturned);
  const auto gain = float(1.0 + trust * (wanted - 1.0));
  host.parallel_for(rows.size(), [&](std::size_t row) {
    const int y = int(row);
    for (int x = 0; x < image.width(); ++x) {
      Vec3f& color = image.at(x, y);
      const Vec3f seen = finite(film.at(x, y).seen).cwiseMin(color);
      color = seen + gain * (color - seen);
    }
  });
}

}  // namespace

Image<Vec3f> undenoised(const Film& film) {
  Image<Vec3f> image(film.width(), film.height(), Vec3f::Zero());
  for (std::size_t i = 0; i < film.pixels().size(); ++i) {
    image.pixels()[i] = film.pixels()[i].seen + film.pixels()[i].scattered;
  }
  return image;
}

double quiet_exposure(const Film& film) {
  const auto blocks = [](int size) { return (size + kExposureBlock - 1) / kExposureBlock; };
  Image<Vec3f> means(blocks(film.width()), blocks(film.height()), Vec3f::Zero());
  for (int y = 0; y < film.height(); ++y) {
    for (int x = 0; x < film.width(); ++x) {
      means.at(x / kExposureBlock, y / kExposureBlock) +=
          finite(film.at(x, y).seen + film.at(x, y).scattered);
    }
  }
  for (int y = 0; y < means.height(); ++y) {
    for (int x = 0; x < means.width(); ++x) {
      const int columns = std::min(kExposureBlock, film.width() - x * kExposureBlock);
      const int rows = std::min(kExposureBlock, film.height() - y * kExposureBlock);
      means.at(x, y) /= float(columns * rows);
    }
  }
  return automatic_exposure(means);
}

void average_chances(Film& film, Host& host) {
  constexpr float kPaths = 128.0f;
  constexpr int kMostReach = 2;
  struct Seen {
    Vec3f albedo;
    Vec3f normal;
    Vec3f position;
    float share;
    float surfaces;
  };
  const std::span<FilmPixel> pixels = film.pixels();
  const auto is_by_chance = [](const FilmPixel& pixel) { return pixel.chance_share > 0.0f; };
  if (std::ranges::none_of(pixels, is_by_chance)) return;
  std::vector<Seen> before(pixels.size());
  std::ranges::transform(pixels, before.begin(), [](const FilmPixel& pixel) {
    return Seen{pixel.albedo, pixel.normal, pixel.position, pixel.chance_share,
                pixel.chance_share * pixel.surface_share};
  });
  host.parallel_for(std::size_t(film.height()), [&](std::size_t row) {
    const int y = int(row);
    for (int x = 0; x < film.width(); ++x) {
      FilmPixel& pixel = film.at(x, y);
      if (!is_by_chance(pixel)) continue;
      int reach = 0;
      while (reach < kMostReach &&
             float((2 * reach + 1) * (2 * reach + 1)) * pixel.count < kPaths) {
        ++reach;
      }
      Seen sum{Vec3f::Zero(), Vec3f::Zero(), Vec3f::Zero(), 0.0f, 0.0f};
      for (int v = std::max(0, y - reach); v < std::min(film.height(), y + reach + 1); ++v) {
        for (int u = std::max(0, x - reach); u < std::min(film.width(), x + reach + 1); ++u) {
          const Seen& near = before[std::size_t(v) * std::size_t(film.width()) + std::size_t(u)];
          const int closeness = (reach + 1 - std::abs(u - x)) * (reach + 1 - std::abs(v - y));
          const float weight = float(closeness) * near.share;
          const float surfaces = float(closeness) * near.surfaces;
          sum.albedo += weight * near.albedo;
          sum.share += weight;
          sum.normal += surfaces * near.normal;
          sum.position += surfaces * near.position;
          sum.surfaces += surfaces;
        }
      }
      const float share = pixel.chance_share;
      pixel.albedo += share * (sum.albedo / sum.share - pixel.albedo);
      if (!(sum.surfaces > 0.0f)) continue;
      pixel.normal += share * (sum.normal / sum.surfaces - pixel.normal);
      pixel.position += share * (sum.position / sum.surfaces - pixel.position);
      pixel.surface_share += share * (sum.surfaces / sum.share - pixel.surface_share);
    }
  });
}

std::size_t denoiser_bytes(int width, int height, bool is_quick) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  if (is_quick) {
    return SparePages::keeps(pixels * sizeof(FilmPixel))
               ? pixels * (sizeof(FilmPixel) + kPlaneFilterBytesPerPixel)
               : pixels * std::max(sizeof(FilmPixel), kPlaneFilterBytesPerPixel);
  }
  return pixels * sizeof(FilmPixel) +
         std::max(pixels * kPlaneFilterBytesPerPixel,
                  pixels * sizeof(Vec3f) + network_filter_bytes(width, height));
}

Image<Vec3f> denoised_on_planes(const Film& film, const DenoiseSettings& settings, Isa isa,
                                Host& host) {
  Image<Vec3f> image = filtered_on_planes(film, settings, isa, host);
  rebalance(image, film, host);
  return image;
}

Image<Vec3f> denoised(Film film, const DenoiseSettings& settings, Isa isa, Host& host) {
  average_chances(film, host);
  if (settings.is_quick || film.pixels().empty()) {
    return filtered_on_planes(std::move(film), settings, isa, host);
  }
  Image<Vec3f> image = filtered_by_network(film, denoised_on_planes(film, settings, isa, host),
                                           settings, quiet_exposure(film), isa, host);
  rebalance(image, film, host);
  return image;
}

}  // namespace diorama
