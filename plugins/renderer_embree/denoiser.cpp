// SPDX-License-Identifier: Apache-2.0
#include "denoiser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "sampling.h"

namespace diorama {
namespace {

constexpr int kRounds = 5;
constexpr std::array<float, 5> kKernel{1 / 16.0f, 4 / 16.0f, 6 / 16.0f, 4 / 16.0f, 1 / 16.0f};
constexpr float kLuminanceSlack = 3.5f;  // standard deviations
constexpr float kNormalSharpness = 40.0f;
constexpr float kPlaneSlack = 0.008f;  // of the distance from the camera
constexpr float kAlbedoSlack = 0.6f;
constexpr float kMinAlbedo = 0.02f;

/// What steers the filter; constant over the rounds.
struct Guide {
  Vec3f normal;
  Vec3f position;
  Vec3f albedo;
  float plane_scale = 0.0f;  ///< 1 / tolerated distance from the plane.
  bool has_surface = false;
};

/// Light that falls on a pixel's surface, whatever its colour.
struct Incoming {
  Vec3f irradiance = Vec3f::Zero();
  float luminance = 0.0f;
  float variance = 0.0f;
  float support = 1.0f;  ///< Share of the neighbours that agreed in the first round.
};

/// Below this share of agreeing neighbours a pixel was hardly averaged: edges, thin things.
constexpr float kLonely = 0.25f;
constexpr int kWitnesses = 10;   // averaged pixels near a lonely one that make it suspect
constexpr float kLeeway = 2.0f;  // by which it may leave their range

struct Grid {
  int width;
  int height;
  std::size_t at(int x, int y) const {
    return std::size_t(y) * std::size_t(width) + std::size_t(x);
  }
};

/// exp(-x) for x >= 0, to 2 %: one weight out of 25 need not be better.
float fast_exp(float x) {
  const float base = std::max(0.0f, 1.0f - x * (1.0f / 16.0f));
  const float b2 = base * base;
  const float b4 = b2 * b2;
  const float b8 = b4 * b4;
  return b8 * b8;
}

float guide_distance(const Guide& p, const Guide& q) {
  const float bend = kNormalSharpness * std::max(0.0f, 1.0f - p.normal.dot(q.normal));
  const float off_plane = std::abs(p.normal.dot(q.position - p.position)) * p.plane_scale;
  const float tint = (p.albedo - q.albedo).cwiseAbs().maxCoeff() * (1.0f / kAlbedoSlack);
  return bend + off_plane + tint * tint;
}

/// Samples that are far brighter than everything around them are chance finds; the brightest
/// believable value is the third brightest neighbour's.
void tame_outliers(const Grid& grid, const std::vector<Guide>& guides,
                   std::vector<Incoming>& lights, Host& host) {
  const std::vector<Incoming> before = lights;
  host.parallel_for(std::size_t(grid.height), [&](std::size_t row) {
    const int y = int(row);
    for (int x = 0; x < grid.width; ++x) {
      const std::size_t i = grid.at(x, y);
      if (!guides[i].has_surface) continue;
      std::array<float, 3> top{0.0f, 0.0f, 0.0f};
      int neighbours = 0;
      for (int v = std::max(0, y - 2); v <= std::min(grid.height - 1, y + 2); ++v) {
        for (int u = std::max(0, x - 2); u <= std::min(grid.width - 1, x + 2); ++u) {
          const std::size_t j = grid.at(u, v);
          if (j == i || !guides[j].has_surface) continue;
          ++neighbours;
          float value = before[j].luminance;
          for (float& t : top) {
            if (value > t) std::swap(value, t);
          }
        }
      }
      const float limit = 1.5f * top[2];
      if (neighbours < 8 || before[i].luminance <= limit) continue;
      const float scale = limit / before[i].luminance;
      lights[i].irradiance = before[i].irradiance * scale;
      lights[i].luminance = limit;
      lights[i].variance = before[i].variance * scale * scale;
    }
  });
}

/// Variances of few samples are noisy themselves.
float smoothed_variance(const Grid& grid, const std::vector<Incoming>& lights, int x, int y) {
  float sum = 0.0f;
  float weights = 0.0f;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const int u = x + dx;
      const int v = y + dy;
      if (u < 0 || v < 0 || u >= grid.width || v >= grid.height) continue;
      const float w = (dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f);
      sum += w * lights[grid.at(u, v)].variance;
      weights += w;
    }
  }
  return sum / weights;
}

Incoming filtered(const Grid& grid, const std::vector<Guide>& guides,
                  const std::vector<Incoming>& lights, int x, int y, int step) {
  const std::size_t i = grid.at(x, y);
  const Guide& p = guides[i];
  const Incoming& own = lights[i];
  const float deviation = std::sqrt(smoothed_variance(grid, lights, x, y));
  const float luminance_scale =
      1.0f / (kLuminanceSlack * deviation + 1e-4f * own.luminance + 1e-8f);
  Vec3f sum = Vec3f::Zero();
  float variance = 0.0f;
  float weights = 0.0f;
  float others = 0.0f;
  for (int dy = -2; dy <= 2; ++dy) {
    const int v = y + dy * step;
    if (v < 0 || v >= grid.height) continue;
    for (int dx = -2; dx <= 2; ++dx) {
      const int u = x + dx * step;
      if (u < 0 || u >= grid.width) continue;
      const std::size_t j = grid.at(u, v);
      if (!guides[j].has_surface) continue;
      const float apart = guide_distance(p, guides[j]) +
                          std::abs(lights[j].luminance - own.luminance) * luminance_scale;
      const float w = kKernel[std::size_t(dx + 2)] * kKernel[std::size_t(dy + 2)] *
                      (j == i ? 1.0f : fast_exp(apart));
      sum += w * lights[j].irradiance;
      variance += w * w * lights[j].variance;
      weights += w;
      if (j != i) others += w;
    }
  }
  Incoming result;
  constexpr float kAllOthers = 1.0f - kKernel[2] * kKernel[2];
  result.support = step == 1 ? others / kAllOthers : own.support;
  result.irradiance = sum / weights;
  result.luminance = luminance(result.irradiance);
  result.variance = variance / (weights * weights);
  return result;
}

/// Pixels that agree with none of their neighbours, mostly mixtures at edges, keep their noise;
/// they may at least be no darker and no brighter than what surrounds them.
void calm_lonely_pixels(const Grid& grid, const std::vector<Guide>& guides,
                        std::vector<Incoming>& lights, Host& host) {
  const std::vector<Incoming> before = lights;
  host.parallel_for(std::size_t(grid.height), [&](std::size_t row) {
    const int y = int(row);
    for (int x = 0; x < grid.width; ++x) {
      const std::size_t i = grid.at(x, y);
      if (!guides[i].has_surface || before[i].support >= kLonely) continue;
      float low = std::numeric_limits<float>::infinity();
      float high = 0.0f;
      int witnesses = 0;
      for (int v = std::max(0, y - 2); v <= std::min(grid.height - 1, y + 2); ++v) {
        for (int u = std::max(0, x - 2); u <= std::min(grid.width - 1, x + 2); ++u) {
          const Incoming& other = before[grid.at(u, v)];
          if (!guides[grid.at(u, v)].has_surface || other.support < kLonely) continue;
          low = std::min(low, other.luminance);
          high = std::max(high, other.luminance);
          ++witnesses;
        }
      }
      if (witnesses < kWitnesses || !(before[i].luminance > 0.0f)) continue;
      const float calm = std::clamp(before[i].luminance, low / kLeeway, high * kLeeway);
      lights[i].irradiance = before[i].irradiance * (calm / before[i].luminance);
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

Image<Vec3f> denoised(const Film& film, const Vec3f& view_position, Host& host) {
  const Grid grid{film.width(), film.height()};
  const std::size_t count = film.pixels().size();
  std::vector<Guide> guides(count);
  std::vector<Incoming> lights(count);
  std::vector<Vec3f> colors(count);
  for (std::size_t i = 0; i < count; ++i) {
    const FilmPixel& pixel = film.pixels()[i];
    Guide& guide = guides[i];
    guide.has_surface = pixel.surface_share > 0.0f;
    const float length = pixel.normal.norm();
    guide.normal = length > 1e-6f ? Vec3f(pixel.normal / length) : Vec3f(Vec3f::UnitZ());
    guide.position = pixel.position;
    guide.albedo = pixel.albedo;
    guide.plane_scale = 1.0f / (kPlaneSlack * (pixel.position - view_position).norm() + 1e-6f);
    colors[i] = pixel.albedo.cwiseMax(kMinAlbedo);
    lights[i].irradiance = pixel.scattered.cwiseQuotient(colors[i]);
    lights[i].luminance = luminance(lights[i].irradiance);
    const float own_color = luminance(colors[i]);
    lights[i].variance = pixel.variance / (own_color * own_color);
  }
  tame_outliers(grid, guides, lights, host);
  std::vector<Incoming> next(count);
  for (int round = 0; round < kRounds; ++round) {
    host.parallel_for(std::size_t(grid.height), [&](std::size_t y) {
      for (int x = 0; x < grid.width; ++x) {
        const std::size_t i = grid.at(x, int(y));
        next[i] = guides[i].has_surface ? filtered(grid, guides, lights, x, int(y), 1 << round)
                                        : lights[i];
      }
    });
    std::swap(lights, next);
  }
  calm_lonely_pixels(grid, guides, lights, host);
  Image<Vec3f> image(film.width(), film.height(), Vec3f::Zero());
  for (std::size_t i = 0; i < count; ++i) {
    image.pixels()[i] = film.pixels()[i].seen + lights[i].irradiance.cwiseProduct(colors[i]);
  }
  return image;
}

}  // namespace diorama
