// SPDX-License-Identifier: Apache-2.0
#include "denoiser.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "network_filter.h"
#include "plane_filter.h"
#include "sampling.h"
#include "view_transform.h"

namespace diorama {
namespace {

constexpr int kExposureBlock = 16;  // pixels
constexpr int kReach = 3;           // of the squares of pixels whose errors are compared
constexpr int kSmoothReach = 2;     // over which shares change
// Of the noise, by which either filter may be off without a sign of it, and how much more of it the
// one that nobody trained; the fewer the paths, the less is known of their noise.
constexpr float kUnseen = 0.05f;
constexpr float kUnseenOfOne = 1.0f;
constexpr float kMoreOfOne = 4.0f;
constexpr double kPriorBias = 0.1;     // what a picture's mean is off by before it is set right
constexpr double kMostReturned = 2.0;  // of the light that is left
constexpr float kDark = 0.1f;        // differences count relative to the light; 0.18 is middle grey
constexpr float kMostLight = 1e15f;  // beyond it there are no sums

float finite(float value) {
  return std::isfinite(value) ? std::clamp(value, -kMostLight, kMostLight) : 0.0f;
}
Vec3f finite(const Vec3f& value) {
  return value.unaryExpr([](float v) { return finite(v); });
}

/// Numbers of a picture, one per pixel.
class Plane {
 public:
  Plane(int width, int height)
      : width_(width), height_(height), values_(std::size_t(width) * std::size_t(height)) {}
  float* row(int y) { return values_.data() + std::size_t(y) * std::size_t(width_); }
  const float* row(int y) const { return values_.data() + std::size_t(y) * std::size_t(width_); }

  /// Sums over squares that reach so far; beside the picture is nothing.
  Plane box_sums(int reach, Host& host) const;

 private:
  int width_;
  int height_;
  std::vector<float> values_;
};

Plane Plane::box_sums(int reach, Host& host) const {
  Plane across(width_, height_);
  host.parallel_for(std::size_t(height_), [&](std::size_t y) {
    const float* const from = row(int(y));
    float* const to = across.row(int(y));
    for (int shift = -reach; shift <= reach; ++shift) {
      const int end = std::min(width_, width_ - shift);
      for (int x = std::max(0, -shift); x < end; ++x) to[x] += from[x + shift];
    }
  });
  Plane sums(width_, height_);
  host.parallel_for(std::size_t(height_), [&](std::size_t y) {
    float* const to = sums.row(int(y));
    const int end = std::min(height_, int(y) + reach + 1);
    for (int v = std::max(0, int(y) - reach); v < end; ++v) {
      const float* const from = across.row(v);
      for (int x = 0; x < width_; ++x) to[x] += from[x];
    }
  });
  return sums;
}

/// What is known of a picture before its noise is removed: luminances of the means, their
/// variances, and what is seen directly.
struct Noisy {
  Noisy(const Film& film, Host& host)
      : light(film.width(), film.height()),
        variance(film.width(), film.height()),
        seen(film.width(), film.height(), Vec3f::Zero()) {
    host.parallel_for(std::size_t(film.height()), [&](std::size_t row) {
      const int y = int(row);
      for (int x = 0; x < film.width(); ++x) {
        const FilmPixel& pixel = film.at(x, y);
        const float own = finite(luminance(pixel.seen + pixel.scattered));
        light.row(y)[x] = own;
        // Of a single path nobody knows.
        variance.row(y)[x] =
            pixel.count > 1.5f ? std::max(0.0f, finite(pixel.variance)) : finite(own * own);
        seen.at(x, y) = finite(pixel.seen);
      }
    });
    double sum = 0.0;
    for (const FilmPixel& pixel : film.pixels()) sum += double(std::max(1.0f, finite(pixel.count)));
    paths = float(sum / double(film.pixels().size()));
  }
  Plane light;
  Plane variance;
  Image<Vec3f> seen;
  float paths;  ///< Per pixel, on average.
};

/// Gives the picture the mean that it had with its noise, as far as that noise lets it be known.
/// What is seen directly stays.
void rebalance(Image<Vec3f>& image, const Noisy& noisy, Host& host) {
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
      const float seen = luminance(noisy.seen.at(x, y));
      sums.before += double(noisy.light.row(y)[x] - seen);
      sums.after += double(finite(luminance(image.at(x, y))) - seen);
      sums.variance += double(noisy.variance.row(y)[x]);
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
      const Vec3f seen = noisy.seen.at(x, y).cwiseMin(color);
      color = seen + gain * (color - seen);
    }
  });
}

/// Into the first of two pictures of one film as much of each as the noisy one around agrees with
/// it: how far it is from that, less what is noise, is an estimate of its squared error (Rousselle
/// et al. 2012 choose among filters by such estimates).
void mix(Image<Vec3f>& by_planes, const Image<Vec3f>& learned, const Noisy& noisy, float dark,
         Host& host) {
  const int width = by_planes.width();
  const int height = by_planes.height();
  Plane planes_error(width, height);
  Plane learned_error(width, height);
  Plane variance(width, height);
  host.parallel_for(std::size_t(height), [&](std::size_t row) {
    const int y = int(row);
    for (int x = 0; x < width; ++x) {
      const float light = noisy.light.row(y)[x];
      const float a = finite(luminance(by_planes.at(x, y)));
      const float b = finite(luminance(learned.at(x, y)));
      const float mean = 0.5f * (a + b);
      const float scale = 1.0f / (mean * mean + dark * dark);
      planes_error.row(y)[x] = (light - a) * (light - a) * scale;
      learned_error.row(y)[x] = (light - b) * (light - b) * scale;
      variance.row(y)[x] = noisy.variance.row(y)[x] * scale;
    }
  });
  planes_error = planes_error.box_sums(kReach, host);
  learned_error = learned_error.box_sums(kReach, host);
  variance = variance.box_sums(kReach, host);
  const float unseen = kUnseen + kUnseenOfOne / noisy.paths;
  const float unseen_of_planes = unseen * (1.0f + kMoreOfOne / noisy.paths);
  Plane share(width, height);
  host.parallel_for(std::size_t(height), [&](std::size_t row) {
    const int y = int(row);
    for (int x = 0; x < width; ++x) {
      const float v = variance.row(y)[x];
      const float a = std::max(0.0f, planes_error.row(y)[x] - v) + unseen_of_planes * v;
      const float b = std::max(0.0f, learned_error.row(y)[x] - v) + unseen * v;
      share.row(y)[x] = a + b > 0.0f ? b / (a + b) : 0.5f;
    }
  });
  share = share.box_sums(kSmoothReach, host);
  host.parallel_for(std::size_t(height), [&](std::size_t row) {
    const int y = int(row);
    const auto near = [](int at, int size) {
      return std::min(size, at + kSmoothReach + 1) - std::max(0, at - kSmoothReach);
    };
    for (int x = 0; x < width; ++x) {
      const float own = share.row(y)[x] / float(near(x, width) * near(y, height));
      const Vec3f& other = learned.at(x, y);
      by_planes.at(x, y) = other + own * (by_planes.at(x, y) - other);
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

std::size_t denoiser_bytes(int width, int height, bool is_quick) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  const std::size_t by_planes = std::max(sizeof(FilmPixel), kPlaneFilterBytesPerPixel);
  if (is_quick) return pixels * by_planes;
  constexpr std::size_t kNoisy = sizeof(Vec3f) + 2 * sizeof(float);
  return std::max(
      pixels * (sizeof(FilmPixel) + sizeof(Vec3f)) + network_filter_bytes(width, height),
      pixels * (by_planes + sizeof(Vec3f) + kNoisy));
}

Image<Vec3f> denoised(Film film, const DenoiseSettings& settings, Isa isa, Host& host) {
  if (settings.is_quick || film.pixels().empty()) {
    return filtered_on_planes(std::move(film), settings, isa, host);
  }
  const double exposure = quiet_exposure(film);
  Image<Vec3f> learned = filtered_by_network(film, settings, exposure, isa, host);
  const Noisy noisy(film, host);  // Not beside the network, which takes most.
  rebalance(learned, noisy, host);
  Image<Vec3f> image = filtered_on_planes(std::move(film), settings, isa, host);
  mix(image, learned, noisy, float(kDark / exposure), host);
  rebalance(image, noisy, host);
  return image;
}

}  // namespace diorama
