// SPDX-License-Identifier: Apache-2.0
#include "modelling/noise.h"

#include <algorithm>
#include <cmath>

namespace diorama::modelling {
namespace {

// Finaliser of SplitMix64 (Steele et al. 2014).
std::uint64_t mix(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

std::uint64_t lattice_bits(std::uint64_t seed, int x, int y) {
  const auto ux = std::uint64_t(std::uint32_t(x));
  const auto uy = std::uint64_t(std::uint32_t(y));
  return mix(seed * 0x9e3779b97f4a7c15ull + (ux << 32 | uy) + 0x632be59bd9b4e019ull);
}

int wrapped(int i, int period) {
  const int r = i % period;
  return r < 0 ? r + period : r;
}

double corner(std::uint64_t seed, int ix, int iy, double dx, double dy) {
  switch (lattice_bits(seed, ix, iy) & 7) {
    case 0:
      return dx + dy;
    case 1:
      return dx - dy;
    case 2:
      return -dx + dy;
    case 3:
      return -dx - dy;
    case 4:
      return 1.4142 * dx;
    case 5:
      return -1.4142 * dx;
    case 6:
      return 1.4142 * dy;
    default:
      return -1.4142 * dy;
  }
}

double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

}  // namespace

double lattice_value(std::uint64_t seed, int x, int y) {
  return double(lattice_bits(seed, x, y) >> 11) * 0x1p-53;
}

double gradient_noise(std::uint64_t seed, double x, double y, int period_x, int period_y) {
  const double fx = std::floor(x);
  const double fy = std::floor(y);
  const double dx = x - fx;
  const double dy = y - fy;
  const int x0 = wrapped(int(fx), period_x);
  const int y0 = wrapped(int(fy), period_y);
  const int x1 = wrapped(x0 + 1, period_x);
  const int y1 = wrapped(y0 + 1, period_y);
  const double u = fade(dx);
  const double v = fade(dy);
  const double a = std::lerp(corner(seed, x0, y0, dx, dy), corner(seed, x1, y0, dx - 1, dy), u);
  const double b =
      std::lerp(corner(seed, x0, y1, dx, dy - 1), corner(seed, x1, y1, dx - 1, dy - 1), u);
  return std::lerp(a, b, v);
}

double fractal_noise(std::uint64_t seed, double x, double y, int period_x, int period_y,
                     int octaves, double gain) {
  double sum = 0.0;
  double height = 1.0;
  double total = 0.0;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += height * gradient_noise(seed + std::uint64_t(octave) * 7919, x, y, period_x, period_y);
    total += height;
    height *= gain;
    x *= 2;
    y *= 2;
    period_x *= 2;
    period_y *= 2;
  }
  return 1.4 * sum / total;
}

CellNoise cell_noise(std::uint64_t seed, double x, double y, int period_x, int period_y) {
  const int cx = int(std::floor(x));
  const int cy = int(std::floor(y));
  CellNoise nearest{1e9, 1e9, 0};
  for (int iy = cy - 1; iy <= cy + 1; ++iy) {
    for (int ix = cx - 1; ix <= cx + 1; ++ix) {
      const int wx = wrapped(ix, period_x);
      const int wy = wrapped(iy, period_y);
      const double px = ix + lattice_value(seed, wx, wy);
      const double py = iy + lattice_value(seed + 1, wx, wy);
      const double d = std::hypot(px - x, py - y);
      if (d < nearest.distance) {
        nearest.second_distance = nearest.distance;
        nearest.distance = d;
        nearest.cell = lattice_bits(seed + 2, wx, wy);
      } else {
        nearest.second_distance = std::min(nearest.second_distance, d);
      }
    }
  }
  return nearest;
}

}  // namespace diorama::modelling
