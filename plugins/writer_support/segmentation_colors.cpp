// SPDX-License-Identifier: Apache-2.0
#include "writer_support/segmentation_colors.h"

#include <array>
#include <cmath>

namespace diorama {
namespace {

struct Hsv {
  double hue;
  double saturation;
  double value;
};

Hsv hsv_of_id(std::uint64_t id) {
  std::uint64_t h = id;
  h ^= h >> 16;
  h *= 0x85EBCA6Bu;
  h ^= h >> 13;
  h *= 0xC2B2AE35u;
  h ^= h >> 16;
  const auto fraction = [](double x) { return x - std::floor(x); };
  const double golden = fraction(double(id) / 1.618033988749895);
  return {fraction(golden + 0.1 * (double(h & 0xFFFF) / 65536.0)),
          0.7 + 0.3 * (double((h >> 16) & 255) / 255.0),
          0.8 + 0.2 * (double((h >> 8) & 255) / 255.0)};
}

}  // namespace

Rgba8 segmentation_color(std::uint32_t id) {
  if (id == 0) return {0, 0, 0, 0};
  if (id == 1) return {0, 0, 0, 255};
  const auto [hue, s, v] = hsv_of_id(id);
  const int sextant = int(hue * 6.0) % 6;
  const double f = hue * 6.0 - std::floor(hue * 6.0);
  const double p = v * (1.0 - s);
  const double q = v * (1.0 - s * f);
  const double t = v * (1.0 - s * (1.0 - f));
  // The fifth sextant holds q where HSV has v: that is how the ids' colours are defined.
  const std::array<std::array<double, 3>, 6> rgb{
      {{v, t, p}, {q, v, p}, {p, v, t}, {p, q, v}, {t, p, q}, {v, p, q}}};
  Rgba8 color{0, 0, 0, 255};
  for (std::size_t c = 0; c < 3; ++c) {
    color[c] = std::uint8_t(rgb[std::size_t(sextant)][c] * 255.0);
  }
  return color;
}

std::string color_text(const Rgba8& color) {
  return "(" + std::to_string(color[0]) + ", " + std::to_string(color[1]) + ", " +
         std::to_string(color[2]) + ", " + std::to_string(color[3]) + ")";
}

std::map<std::uint32_t, Rgba8> distinct_colors(const std::set<std::uint32_t>& ids) {
  std::map<std::uint32_t, Rgba8> colors;
  std::set<Rgba8> taken{segmentation_color(0), segmentation_color(1)};
  for (const std::uint32_t id : ids) {
    Rgba8 color = segmentation_color(id);
    for (std::uint32_t next = id + 1; id > 1 && taken.contains(color); ++next) {
      color = segmentation_color(next);
    }
    taken.insert(color);
    colors.emplace(id, color);
  }
  return colors;
}

}  // namespace diorama
