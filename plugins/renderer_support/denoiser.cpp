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

/// What a pixel's paths found that chose their way.
struct SeenByChance {
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();
  Vec3f lights = Vec3f::Zero();
  float share = 0.0f;     ///< Of all paths.
  float surfaces = 0.0f;  ///< Share of the paths that met one.
};

/// Whether so many of the pixel's paths came to no surface as paths of which one in so many does
/// not, and there are too few of them to tell how bright a light is that is seen so.
bool is_chance(const FilmPixel& pixel, float probability) {
  constexpr float kLeastPaths = 4.0f;
  const float found = pixel.count * (1.0f - pixel.surface_share);
  const float expected = pixel.count * probability;
  const float deviation = std::sqrt(expected * (1.0f - probability));
  return pixel.count >= kLeastPaths && std::abs(found - expected) <= 2.0f * deviation + 0.5f &&
         deviation > 0.1f * expected;
}

void average_chances(FilmPixel& pixel, const Image<SeenByChance>& before, int x, int y) {
  constexpr float kPaths = 128.0f;
  constexpr int kMostReach = 2;
  int reach = 0;
  while (reach < kMostReach && float((2 * reach + 1) * (2 * reach + 1)) * pixel.count < kPaths) {
    ++reach;
  }
  const int looked_at = std::max(reach, 1);  // for lights at least so far
  SeenByChance sum;
  float light_weights = 0.0f;
  int lit = 0;
  int neighbours = 0;
  float without_surface = 0.0f;
  for (int v = std::max(0, y - looked_at); v < std::min(before.height(), y + looked_at + 1); ++v) {
    for (int u = std::max(0, x - looked_at); u < std::min(before.width(), x + looked_at + 1); ++u) {
      const SeenByChance& near = before.at(u, v);
      const int away_x = std::abs(u - x);
      const int away_y = std::abs(v - y);
      const float weight = float((reach + 1 - away_x) * (reach + 1 - away_y)) * near.share;
      const float on_surfaces = weight * near.surfaces;
      sum.albedo += weight * near.albedo;
      sum.share += weight;
      sum.normal += on_surfaces * near.normal;
      sum.position += on_surfaces * near.position;
      sum.surfaces += on_surfaces;
      if (away_x > 1 || away_y > 1) continue;
      const float light_weight = float((2 - away_x) * (2 - away_y)) * near.share;
      sum.lights += light_weight * near.lights;
      light_weights += light_weight;
      if (away_x + away_y == 0 || !(near.share > 0.0f)) continue;
      lit += luminance(near.lights) > 0.0f ? 1 : 0;
      ++neighbours;
      without_surface += 1.0f - near.surfaces;
    }
  }
  const float share = pixel.chance_share;
  pixel.albedo += share * (sum.albedo / sum.share - pixel.albedo);
  if (lit >= 4 && is_chance(pixel, without_surface / float(neighbours))) {
    pixel.seen += share * (sum.lights / light_weights - pixel.seen);
  }
  if (!(sum.surfaces > 0.0f)) return;
  pixel.normal += share * (sum.normal / sum.surfaces - pixel.normal);
  pixel.position += share * (sum.position / sum.surfaces - pixel.position);
  pixel.surface_share += share * (sum.surfaces / sum.share - pixel.surface_share);
}

/// By rows: 1 where a pixel or one beside it shows light directly.
std::vector<std::uint8_t> beside_lights(const Film& film, Host& host) {
  const auto width = std::size_t(film.width());
  std::vector<std::uint8_t> shine(width * std::size_t(film.height()));
  host.parallel_for(std::size_t(film.height()), [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      shine[y * width + x] = luminance(film.at(int(x), int(y)).seen) != 0.0f ? 1 : 0;
    }
  });
  std::vector<std::uint8_t> beside(shine.size());
  host.parallel_for(std::size_t(film.height()), [&](std::size_t y) {
    const std::size_t last = std::min(y + 2, std::size_t(film.height()));
    for (std::size_t v = y > 0 ? y - 1 : 0; v < last; ++v) {
      for (std::size_t x = 0; x < width; ++x) {
        const std::size_t left = x > 0 ? x - 1 : x;
        const std::size_t right = std::min(x + 1, width - 1);
        beside[y * width + x] |=
            shine[v * width + left] | shine[v * width + x] | shine[v * width + right];
      }
    }
  });
  return beside;
}

/// Gives the picture the mean that it had with its noise, as far as that noise lets it be known.
/// What is seen directly stays, and what is beside it says nothing: edges of lamps, which are
/// thousands of times as bright, are smoothed.
void rebalance(Image<Vec3f>& image, const Film& film, Host& host) {
  struct Sums {
    double before = 0.0;
    double after = 0.0;
    double variance = 0.0;
  };
  const std::vector<std::uint8_t> is_beside_light = beside_lights(film, host);
  std::vector<Sums> rows(std::size_t(image.height()));
  host.parallel_for(rows.size(), [&](std::size_t row) {
    const int y = int(row);
    Sums sums;
    for (int x = 0; x < image.width(); ++x) {
      if (is_beside_light[row * std::size_t(image.width()) + std::size_t(x)] != 0) continue;
      const FilmPixel& pixel = film.at(x, y);
      const float light = finite(luminance(pixel.scattered));
      sums.before += double(light);
      sums.after += double(finite(luminance(image.at(x, y))));
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
  const std::span<FilmPixel> pixels = film.pixels();
  const auto is_by_chance = [](const FilmPixel& pixel) { return pixel.chance_share > 0.0f; };
  if (std::ranges::none_of(pixels, is_by_chance)) return;
  Image<SeenByChance> before(film.width(), film.height(), {});
  std::ranges::transform(pixels, before.pixels().begin(), [](const FilmPixel& pixel) {
    return SeenByChance{pixel.albedo, pixel.normal,       pixel.position,
                        pixel.seen,   pixel.chance_share, pixel.surface_share};
  });
  host.parallel_for(std::size_t(film.height()), [&](std::size_t row) {
    const int y = int(row);
    for (int x = 0; x < film.width(); ++x) {
      if (is_by_chance(film.at(x, y))) average_chances(film.at(x, y), before, x, y);
    }
  });
}

std::size_t denoiser_bytes(int width, int height, bool is_quick) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  if (is_quick) {
    return SparePages::keeps(pixels * sizeof(FilmPixel))
               ? pixels * (sizeof(FilmPixel) + kPlaneFilterBytesPerPixel)
               : pixels *
                     std::max(sizeof(FilmPixel) + sizeof(SeenByChance), kPlaneFilterBytesPerPixel);
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
