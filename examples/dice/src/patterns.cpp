// SPDX-License-Identifier: Apache-2.0
#include "patterns.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace dice {

using diorama::Rng;
using diorama::Vec3;
using diorama::Vec3f;

namespace {

std::uint64_t mixed(std::uint64_t seed, std::int64_t x, std::int64_t y, std::int64_t z) {
  std::uint64_t h = seed;
  for (const std::int64_t v : {x, y, z}) {
    h = (h ^ std::uint64_t(v)) * 0x9E3779B97F4A7C15ull;
    h ^= h >> 32;
  }
  h *= 0xD6E8FEB86659FD93ull;
  return h ^ (h >> 32);
}

double unit(std::uint64_t bits) { return double(bits >> 11) * 0x1.0p-53; }

double smooth_noise(std::uint64_t seed, const Vec3& at) {
  const Vec3 cell = at.array().floor();
  const Vec3 t = at - cell;
  const Vec3 s = t.array() * t.array() * (3.0 - 2.0 * t.array());
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const int dx = corner & 1, dy = (corner >> 1) & 1, dz = corner >> 2;
    const double weight =
        (dx ? s.x() : 1.0 - s.x()) * (dy ? s.y() : 1.0 - s.y()) * (dz ? s.z() : 1.0 - s.z());
    sum += weight * unit(mixed(seed, std::int64_t(cell.x()) + dx, std::int64_t(cell.y()) + dy,
                               std::int64_t(cell.z()) + dz));
  }
  return 2.0 * sum - 1.0;
}

}  // namespace

Color mix(const Color& a, const Color& b, double t) { return a + float(t) * (b - a); }

double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

Color from_hsv(double hue, double saturation, double value) {
  const auto channel = [&](double shift) {
    const double k = std::fmod(shift + hue * 6.0, 6.0);
    return float(value - value * saturation * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

Color any_color(Rng& rng) {
  const double kind = rng.uniform();
  const double hue = rng.uniform();
  const double a = rng.uniform();
  const double b = rng.uniform();
  if (kind < 0.14) return from_hsv(0.08 + 0.08 * hue, 0.18 * a, 0.82 + 0.18 * b);  // white, ivory
  if (kind < 0.28) return from_hsv(hue, 0.4 * a, 0.04 + 0.16 * b);                 // black
  if (kind < 0.36) return from_hsv(hue, 0.12 * a, 0.25 + 0.5 * b);                 // grey
  if (kind < 0.48)
    return from_hsv(0.05 + 0.07 * hue, 0.5 + 0.5 * a, 0.3 + 0.55 * b);  // brown, gold
  return from_hsv(hue, 0.5 + 0.5 * a, 0.2 + 0.75 * b);
}

Vec3f linear(const Color& color) {
  return color.unaryExpr(
      [](float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); });
}

double noise(std::uint64_t seed, const Vec3& at, int octaves) {
  double sum = 0.0, height = 1.0, total = 0.0, scale = 1.0;
  for (int i = 0; i < octaves; ++i) {
    sum += height * smooth_noise(seed + std::uint64_t(i), scale * at);
    total += height;
    height *= 0.5;
    scale *= 2.03;
  }
  return sum / total;
}

NearestPoint nearest_point(std::uint64_t seed, const Vec3& at) {
  const Vec3 cell = at.array().floor();
  const Vec3 inside = at - cell;
  double least = diorama::kInfinity;  // squared
  std::uint64_t nearest = 0;
  // The own cell first: most of the others are farther away than its point.
  constexpr std::array kSteps{0, -1, 1};
  for (int i = 0; i < 27; ++i) {
    const std::array steps{kSteps[std::size_t(i % 3)], kSteps[std::size_t(i / 3 % 3)],
                           kSteps[std::size_t(i / 9)]};
    double gap = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = inside[Eigen::Index(axis)];
      const double to_cell = steps[axis] == 0 ? 0.0 : steps[axis] < 0 ? x : 1.0 - x;
      gap += to_cell * to_cell;
    }
    if (gap >= least) continue;
    const Vec3 neighbour = cell + Vec3(steps[0], steps[1], steps[2]);
    const std::uint64_t number = mixed(seed, std::int64_t(neighbour.x()),
                                       std::int64_t(neighbour.y()), std::int64_t(neighbour.z()));
    const Vec3 point =
        neighbour + Vec3(unit(number), unit(mixed(number, 1, 0, 0)), unit(mixed(number, 2, 0, 0)));
    const double distance = (point - at).squaredNorm();
    if (distance < least) {
      least = distance;
      nearest = number;
    }
  }
  return {std::sqrt(least), nearest};
}

std::shared_ptr<const diorama::Texture> painted(
    const std::string& name, int width, int height,
    const std::function<Color(double x, double y)>& shade) {
  auto texture = std::make_shared<diorama::Texture>();
  texture->name = name;
  texture->width = width;
  texture->height = height;
  texture->channels = 3;
  texture->color_space = diorama::ColorSpace::Srgb;
  texture->bytes.reserve(std::size_t(width) * std::size_t(height) * 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Color color = shade(x + 0.5, y + 0.5);
      for (int k = 0; k < 3; ++k) {
        texture->bytes.push_back(
            std::uint8_t(std::lround(255.0f * std::clamp(color[k], 0.0f, 1.0f))));
      }
    }
  }
  return texture;
}

}  // namespace dice
