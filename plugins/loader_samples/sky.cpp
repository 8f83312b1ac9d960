// SPDX-License-Identifier: Apache-2.0
#include "loader_samples/sky.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "diorama/rng.h"
#include "loader_samples/indoor.h"
#include "modelling/noise.h"

namespace diorama::samples {

using modelling::fractal_noise;
using modelling::lattice_value;

namespace {

constexpr int kWidth = 1024;
constexpr int kHeight = 512;
constexpr double kDegree = kPi / 180;
constexpr int kFar = 4096;  ///< Noise that need not repeat.

double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Perez' distribution with the coefficients of Preetham et al.
struct Perez {
  double a, b, c, d, e;
  double at(double cos_zenith, double gamma) const {
    const double cg = std::cos(gamma);
    return (1 + a * std::exp(b / std::max(0.035, cos_zenith))) *
           (1 + c * std::exp(d * gamma) + e * cg * cg);
  }
};

class DaySky {
 public:
  DaySky(double turbidity, double sun_elevation) {
    const double t = turbidity;
    const double s = kPi / 2 - sun_elevation;
    luminance_ = {0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251,
                  0.1206 * t - 2.5771, -0.0670 * t + 0.3703};
    x_ = {-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989,
          -0.0033 * t + 0.0452};
    y_ = {-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537,
          -0.0109 * t + 0.0529};
    const double chi = (4.0 / 9 - t / 120) * (kPi - 2 * s);
    zenith_luminance_ = (4.0453 * t - 4.9710) * std::tan(chi) - 0.2155 * t + 2.4192;
    const double s2 = s * s, s3 = s2 * s;
    zenith_x_ = t * t * (0.00166 * s3 - 0.00375 * s2 + 0.00209 * s) +
                t * (-0.02903 * s3 + 0.06377 * s2 - 0.03202 * s + 0.00394) +
                (0.11693 * s3 - 0.21196 * s2 + 0.06052 * s + 0.25886);
    zenith_y_ = t * t * (0.00275 * s3 - 0.00610 * s2 + 0.00317 * s) +
                t * (-0.04214 * s3 + 0.08970 * s2 - 0.04153 * s + 0.00516) +
                (0.15346 * s3 - 0.26756 * s2 + 0.06670 * s + 0.26688);
    sun_zenith_ = s;
  }

  Vec3 color(double cos_zenith, double gamma) const {
    const double luminance =
        zenith_luminance_ * luminance_.at(cos_zenith, gamma) / luminance_.at(1, sun_zenith_);
    const double x = zenith_x_ * x_.at(cos_zenith, gamma) / x_.at(1, sun_zenith_);
    const double y = zenith_y_ * y_.at(cos_zenith, gamma) / y_.at(1, sun_zenith_);
    const Vec3 xyz(x / y, 1, (1 - x - y) / y);
    const Vec3 rgb(3.2404542 * xyz.x() - 1.5371385 * xyz.y() - 0.4985314 * xyz.z(),
                   -0.9692660 * xyz.x() + 1.8760108 * xyz.y() + 0.0415560 * xyz.z(),
                   0.0556434 * xyz.x() - 0.2040259 * xyz.y() + 1.0572252 * xyz.z());
    return std::max(0.0, luminance) * rgb.cwiseMax(0.0);
  }

 private:
  Perez luminance_{}, x_{}, y_{};
  double zenith_luminance_ = 0, zenith_x_ = 0, zenith_y_ = 0, sun_zenith_ = 0;
};

/// A sky before its brightness is set.
class Painter {
 public:
  explicit Painter(const SkyLook& look)
      : look_(look),
        seed_(stable_hash(look.name)),
        day_(look.turbidity, std::max(3.0, look.sun_elevation_deg) * kDegree) {
    const double e = look.sun_elevation_deg * kDegree, a = look.sun_azimuth_deg * kDegree;
    sun_ = Vec3(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
    const double low = 1 - smooth_step(0, 30, look.sun_elevation_deg);
    sunlight_ = look.is_night ? Vec3(0.75, 0.85, 1.0) : Vec3(1.0, 1 - 0.42 * low, 1 - 0.75 * low);
  }
  const Vec3& sun() const { return sun_; }
  const Vec3& sunlight() const { return sunlight_; }

  Vec3 sky(const Vec3& d) const {
    const double up = std::max(0.0, d.z());
    const double gamma = std::acos(std::clamp(d.dot(sun_), -1.0, 1.0));
    Vec3 c = look_.is_night ? night(d, up, gamma) : day_.color(up, gamma);
    return with_clouds(d, gamma, c);
  }

  Vec3 ground(const Vec3& d) const {
    const double t = 1.7 / std::max(0.004, -d.z());  // eye 1.7 m above the ground
    const double x = d.x() * t, y = d.y() * t;
    const double far = smooth_step(8, 160, t);
    const double broad =
        0.5 + 0.5 * fractal_noise(seed_ + 41, x * 0.08 + 900, y * 0.08 + 900, kFar, kFar, 4);
    const double fine =
        (0.5 + 0.5 * fractal_noise(seed_ + 43, x * 2 + 900, y * 2 + 900, kFar, kFar, 4)) *
            (1 - far) +
        0.5 * far;
    Vec3 c = Vec3::Zero();
    switch (look_.ground) {
      case Ground::Grass:
        c = Vec3(0.07, 0.12, 0.03) + Vec3(0.06, 0.05, 0.02) * broad;
        break;
      case Ground::Dirt:
        c = Vec3(0.22, 0.16, 0.10) + Vec3(0.06, 0.05, 0.04) * broad;
        break;
      case Ground::Road:
        c = std::abs(y) < 3.2 ? Vec3(0.09, 0.09, 0.09)
                              : Vec3(0.12, 0.13, 0.06) + Vec3(0.06, 0.03, 0.02) * broad;
        if (std::abs(y) < 0.08 && std::fmod(std::abs(x), 6.0) < 3.0) c = Vec3(0.5, 0.48, 0.42);
        break;
      case Ground::Heath:
        c = Vec3(0.16, 0.14, 0.07) + Vec3(0.05, 0.04, 0.03) * broad;
        break;
    }
    return c * (0.7 + 0.6 * fine);
  }

  /// Height of hills and trees above the horizon, radians, in two layers.
  double skyline(double azimuth, int layer) const {
    const double turn = azimuth / (2 * kPi) + 0.5;
    const double hills =
        fractal_noise(seed_ + 60 + std::uint64_t(layer), turn * 7, 0.5, 7, kFar, 4);
    const double trees =
        layer == 0 ? 0.0 : std::abs(fractal_noise(seed_ + 70, turn * 90, 0.5, 90, kFar, 4));
    return (layer == 0 ? 0.045 : 0.016) * (1 + hills) + 0.035 * trees;
  }

 private:
  Vec3 night(const Vec3& d, double up, double gamma) const {
    const Vec3 air = Vec3(0.22, 0.33, 0.62) * (0.45 + 0.55 * std::pow(1 - up, 3.0)) +
                     Vec3(0.30, 0.36, 0.48) * std::exp(-gamma * 5) +
                     Vec3(0.5, 0.38, 0.25) * 0.5 * std::exp(-up * 14);
    // Stars on a fine grid over the sphere.
    const double lon = std::atan2(d.y(), d.x()), lat = std::asin(std::clamp(d.z(), -1.0, 1.0));
    const int row = int(std::floor((lat + kPi / 2) / kPi * kHeight));
    const int columns = std::max(1, int(kWidth * std::cos(lat)));
    const int column = int(std::floor((lon + kPi) / (2 * kPi) * columns));
    const double star = lattice_value(seed_ + 5, column, row);
    if (star < 0.9965) return air;
    const double bright = std::pow(lattice_value(seed_ + 6, column, row), 6.0) * 40 + 2;
    const double tint = lattice_value(seed_ + 7, column, row);
    return air +
           bright * smooth_step(0.0, 0.2, up) * Vec3(1.0, 0.9 + 0.1 * tint, 0.75 + 0.4 * tint);
  }

  Vec3 with_clouds(const Vec3& d, double gamma, const Vec3& c) const {
    if (look_.cloud_cover <= 0 || d.z() <= 0) return c;
    const double t = 1 / (d.z() + 0.10);
    const double x = d.x() * t, y = d.y() * t;
    const double shape =
        fractal_noise(seed_ + 21, x * 1.1 + 500, y * 1.1 + 500, kFar, kFar, 7, 0.55);
    const double limit = 0.55 - 1.1 * look_.cloud_cover;
    const double density = smooth_step(limit, limit + 0.28, shape);
    const double thick = smooth_step(limit + 0.1, limit + 0.55, shape);
    // Nearer to the sun than the point itself: less cloud there means a lit edge.
    const double toward = fractal_noise(seed_ + 21, (x + 0.12 * sun_.x()) * 1.1 + 500,
                                        (y + 0.12 * sun_.y()) * 1.1 + 500, kFar, kFar, 5, 0.55);
    const double lit = std::clamp(0.55 + 1.6 * (shape - toward), 0.15, 1.2);
    const double glow = 1 + 1.5 * std::exp(-gamma * 3.5);
    const double level = c.sum() / 3;
    const double floor = look_.is_night ? level : level * 0.4 + 4.5;
    const Vec3 cloud =
        floor * (1.5 * lit * (1 - 0.55 * thick) * glow * sunlight_ + 0.35 * Vec3(0.8, 0.9, 1.0));
    return c + (cloud - c) * (density * smooth_step(0.0, 0.10, d.z()));
  }

  SkyLook look_;
  std::uint64_t seed_;
  DaySky day_;
  Vec3 sun_, sunlight_;
};

/// Of a pixel's centre, or beside it.
Vec3 direction(double column, double row) {
  // Column centre +x, the right half towards -y.
  const double azimuth = -((column + 0.5) / kWidth - 0.5) * 2 * kPi;
  const double elevation = (0.5 - (row + 0.5) / kHeight) * kPi;
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

double luminance(const Vec3& c) { return c.dot(Vec3(0.2126, 0.7152, 0.0722)); }

double solid_angle(int row) {
  const double pixel = kPi / kHeight;
  return pixel * pixel * std::cos((0.5 - (row + 0.5) / kHeight) * kPi);
}

using Pixels = std::vector<Vec3>;

/// Light from above on level ground, by its cosine; without the sun's disc.
Vec3 sky_irradiance(const Pixels& image) {
  Vec3 sum = Vec3::Zero();
  for (int row = 0; row < kHeight / 2; ++row) {
    for (int x = 0; x < kWidth; ++x) {
      sum += image[std::size_t(row * kWidth + x)] * solid_angle(row) * direction(x, row).z();
    }
  }
  return sum;
}

void paint_sky(Pixels& image, const Painter& painter, double mean_luminance, Host& host) {
  host.parallel_for(kHeight / 2, [&](std::size_t row) {
    for (int x = 0; x < kWidth; ++x) {
      image[row * kWidth + std::size_t(x)] = painter.sky(direction(x, int(row)));
    }
  });
  double sum = 0, weight = 0;
  for (int row = 0; row < kHeight / 2; ++row) {
    for (int x = 0; x < kWidth; ++x) {
      sum += luminance(image[std::size_t(row * kWidth + x)]) * solid_angle(row);
      weight += solid_angle(row);
    }
  }
  for (Vec3& c : image) c *= mean_luminance * weight / sum;
}

/// Spreads the disc's power over the few pixels around it; returns the light on level ground.
Vec3 paint_sun(Pixels& image, const Painter& painter, double irradiance) {
  constexpr double kSpread = 0.0085;  // radians: 1.4 pixels
  std::vector<std::pair<std::size_t, double>> shares;
  double total = 0;
  for (int row = 0; row < kHeight / 2; ++row) {
    for (int x = 0; x < kWidth; ++x) {
      const double gamma = std::acos(std::clamp(direction(x, row).dot(painter.sun()), -1.0, 1.0));
      if (gamma > 3 * kSpread) continue;
      const double share = std::exp(-0.5 * std::pow(gamma / kSpread, 2.0));
      shares.emplace_back(std::size_t(row * kWidth + x), share);
      total += share * solid_angle(row);
    }
  }
  for (const auto& [pixel, share] : shares)
    image[pixel] += painter.sunlight() * (irradiance * share / total);
  return painter.sunlight() * irradiance * std::max(0.0, painter.sun().z());
}

void paint_land(Pixels& image, const Painter& painter, const Vec3& irradiance, Host& host) {
  const Vec3 haze = image[std::size_t((kHeight / 2 - 2) * kWidth)];
  host.parallel_for(kHeight, [&](std::size_t row) {
    for (int x = 0; x < kWidth; ++x) {
      const Vec3 d = direction(x, int(row));
      Vec3& c = image[row * kWidth + std::size_t(x)];
      const double elevation = std::asin(std::clamp(d.z(), -1.0, 1.0));
      const double azimuth = std::atan2(d.y(), d.x());
      const Vec3 lit = irradiance / kPi;
      if (elevation < 0) {
        const double far = smooth_step(-0.12, 0.0, elevation);
        c = painter.ground(d).cwiseProduct(lit) * (1 - 0.55 * far) + 0.35 * haze * (0.55 * far);
      } else if (elevation < painter.skyline(azimuth, 1)) {
        c = Vec3(0.045, 0.06, 0.03).cwiseProduct(lit) + 0.08 * haze;
      } else if (elevation < painter.skyline(azimuth, 0)) {
        c = Vec3(0.09, 0.11, 0.10).cwiseProduct(lit) + 0.30 * haze;
      }
    }
  });
}

void paint_outdoors(Pixels& image, const SkyLook& look, Host& host) {
  const Painter painter(look);
  paint_sky(image, painter, look.mean_luminance, host);
  Vec3 irradiance = sky_irradiance(image);
  // A clear noon's direct light is some five times that of the sky, less through a long path of
  // air.
  const double direct = 5.0 * look.sun_strength * look.mean_luminance * kPi *
                        (look.is_night ? 0.4 : smooth_step(-2, 35, look.sun_elevation_deg));
  irradiance += paint_sun(image, painter, direct);
  paint_land(image, painter, irradiance, host);
}

constexpr SkyLook kSkies[] = {
    {"Cloudy/champagne_castle_1_4k", 38, 55, 3.2, 0.62, 0.75, 0.35, false, Ground::Heath},
    {"Cloudy/kloofendal_48d_partly_cloudy_4k", 48, -35, 2.6, 0.42, 0.80, 0.8, false, Ground::Heath},
    {"Clear/evening_road_01_4k", 24, 120, 3.0, 0.18, 0.60, 0.8, false, Ground::Road},
    {"Clear/mealie_road_4k", 42, 25, 2.4, 0.12, 0.75, 1.0, false, Ground::Dirt},
    {"Clear/qwantani_4k", 30, -150, 2.2, 0.0, 0.70, 1.0, false, Ground::Heath},
    {"Clear/noon_grass_4k", 68, 80, 2.3, 0.25, 0.90, 1.0, false, Ground::Grass},
    {"Evening/evening_road_01_4k", 7, 160, 4.0, 0.30, 0.22, 0.6, false, Ground::Road},
    {"Night/kloppenheim_02_4k", 34, 60, 3.0, 0.30, 0.004, 0.5, true, Ground::Grass},
    {"Night/moonlit_golf_4k", 48, -70, 3.0, 0.10, 0.006, 1.0, true, Ground::Grass},
    {.name = "Indoor/autoshop_01_4k", .is_indoor = true},
    {.name = "Indoor/carpentry_shop_01_4k", .is_indoor = true},
    {.name = "Indoor/hotel_room_4k", .is_indoor = true},
    {.name = "Indoor/wooden_lounge_4k", .is_indoor = true},
};

}  // namespace

std::span<const SkyLook> skies() { return kSkies; }

std::shared_ptr<const Texture> make_sky(const SkyLook& look, Host& host) {
  Pixels image(std::size_t(kWidth) * kHeight, Vec3::Zero());
  if (look.is_indoor) {
    const RoomView room(look.name);
    host.parallel_for(kHeight, [&](std::size_t row) {
      for (int x = 0; x < kWidth; ++x) {
        // Edges are sharp, so pixels are means.
        constexpr int kSide = 3;
        Vec3 sum = Vec3::Zero();
        for (int i = 0; i < kSide * kSide; ++i) {
          sum += room.radiance(direction(x + (i % kSide + 0.5) / kSide - 0.5,
                                         int(row) + (i / kSide + 0.5) / kSide - 0.5));
        }
        image[row * kWidth + std::size_t(x)] = sum / (kSide * kSide);
      }
    });
  } else {
    paint_outdoors(image, look, host);
  }
  Texture texture;
  texture.name = std::string(look.name);
  texture.width = kWidth;
  texture.height = kHeight;
  texture.channels = 3;
  texture.floats.reserve(image.size() * 3);
  for (const Vec3& c : image) {
    for (int k = 0; k < 3; ++k) texture.floats.push_back(float(c[k]));
  }
  return std::make_shared<const Texture>(std::move(texture));
}

}  // namespace diorama::samples
