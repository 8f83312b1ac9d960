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

/// Which light a pixel and those beside it show directly.
enum class Lights : std::uint8_t { None, Even, Edge };

std::vector<Lights> lights_seen(const Film& film, Host& host) {
  const auto width = std::size_t(film.width());
  const auto height = std::size_t(film.height());
  std::vector<float> light(width * height);
  host.parallel_for(height, [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      light[y * width + x] = finite(luminance(film.at(int(x), int(y)).seen));
    }
  });
  std::vector<Lights> seen(light.size());
  host.parallel_for(height, [&](std::size_t y) {
    const float* rows[] = {&light[(y > 0 ? y - 1 : y) * width], &light[y * width],
                           &light[std::min(y + 1, height - 1) * width]};
    std::vector<float> least(rows[1], rows[1] + width);
    std::vector<float> most = least;
    for (const float* row : {rows[0], rows[2]}) {
      for (std::size_t x = 0; x < width; ++x) {
        least[x] = std::min(least[x], row[x]);
        most[x] = std::max(most[x], row[x]);
      }
    }
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t left = x > 0 ? x - 1 : x;
      const std::size_t right = std::min(x + 1, width - 1);
      const float low = std::min(least[x], std::min(least[left], least[right]));
      const float high = std::max(most[x], std::max(most[left], most[right]));
      seen[y * width + x] = high == 0.0f ? Lights::None : low == high ? Lights::Even : Lights::Edge;
    }
  });
  return seen;
}

/// Of pixels, with noise and without.
struct Sums {
  double before = 0.0;
  double after = 0.0;
  double variance = 0.0;

  void add(const Sums& other) {
    before += other.before;
    after += other.after;
    variance += other.variance;
  }
  /// Which gives the mean back, as far as noise lets it be known.
  float gain() const {
    if (!(before > 0.0 && after > 0.0)) return 1.0f;
    const double uncertain = variance / (before * before);
    const double trust = kPriorBias * kPriorBias / (kPriorBias * kPriorBias + uncertain);
    const double wanted = std::clamp(before / after, 1.0 / kMostReturned, kMostReturned);
    return float(1.0 + trust * (wanted - 1.0));
  }
};

/// Gives the picture the mean that it had with its noise, as far as that noise lets it be known.
/// What is seen directly stays. Its edges, which are smoothed, have a mean of their own: lamps are
/// thousands of times as bright as what is around.
void rebalance(Image<Vec3f>& image, const Film& film, Host& host) {
  const std::vector<Lights> seen = lights_seen(film, host);
  const auto width = std::size_t(image.width());
  struct Row {
    Sums surfaces;
    Sums edges;
  };
  std::vector<Row> rows(std::size_t(image.height()));
  host.parallel_for(rows.size(), [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      const Lights lights = seen[y * width + x];
      if (lights == Lights::Even) continue;
      const FilmPixel& pixel = film.at(int(x), int(y));
      const float light = finite(luminance(pixel.seen + pixel.scattered));
      // Of a single path nobody knows.
      const float variance =
          pixel.count > 1.5f ? std::max(0.0f, finite(pixel.variance)) : finite(light * light);
      Sums& sums = lights == Lights::Edge ? rows[y].edges : rows[y].surfaces;
      sums.add(
          {double(light), double(finite(luminance(image.at(int(x), int(y))))), double(variance)});
    }
  });
  Row all;
  for (const Row& row : rows) {
    all.surfaces.add(row.surfaces);
    all.edges.add(row.edges);
  }
  const float of_surfaces = all.surfaces.gain();
  const float of_edges = all.edges.gain();
  host.parallel_for(rows.size(), [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      Vec3f& color = image.at(int(x), int(y));
      if (seen[y * width + x] == Lights::Edge) {
        color *= of_edges;
        continue;
      }
      const Vec3f shone = finite(film.at(int(x), int(y)).seen).cwiseMin(color);
      color = shone + of_surfaces * (color - shone);
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
