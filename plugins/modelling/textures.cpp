// SPDX-License-Identifier: Apache-2.0
#include "modelling/textures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "modelling/noise.h"

namespace diorama::modelling {
namespace {

double fraction(double x) { return x - std::floor(x); }

double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Color scaled_color(const Color& c, double factor) { return c * float(factor); }

/// Colour of a board at u (along the grain) and v; both count in repeats of a tiling texture.
Color wood_color(const WoodLook& look, std::uint64_t seed, double u, double v) {
  const double warp = fractal_noise(seed, u * 1, v * 3, 1, 3, 3);
  const double drift = fractal_noise(seed + 11, u * 1, v * 4, 1, 4, 2);
  const double rings = fraction(v * 9 + 1.0 * warp);
  // Early wood fades slowly into a narrow band of late wood.
  const double late = smooth_step(0.35, 0.93, rings) * (1 - smooth_step(0.94, 1.0, rings));
  const double fibre = fractal_noise(seed + 23, u * 6, v * 160, 6, 160, 2);
  const double pores =
      smooth_step(0.42, 0.62, fractal_noise(seed + 31, u * 12, v * 220, 12, 220, 1));
  const double t =
      0.35 + look.contrast * (0.55 * late - 0.12) + 0.22 * drift + 0.16 * fibre * look.contrast;
  return scaled_color(blend(look.light, look.dark, t), 1 - 0.22 * pores * look.contrast);
}

std::shared_ptr<const Texture> texture_from(const char* name, const char* kind, int pixels,
                                            ColorSpace space, std::vector<std::uint8_t> bytes) {
  Texture texture;
  texture.name = std::string(name) + kind;
  texture.width = pixels;
  texture.height = pixels;
  texture.channels = 3;
  texture.color_space = space;
  texture.bytes = std::move(bytes);
  return std::make_shared<const Texture>(std::move(texture));
}

std::uint8_t byte_of(double value) {
  return std::uint8_t(std::clamp(value, 0.0, 1.0) * 255.0 + 0.5);
}

std::vector<std::uint8_t> normal_bytes(const std::vector<float>& heights, int pixels,
                                       double size_m) {
  std::vector<std::uint8_t> bytes(std::size_t(pixels) * std::size_t(pixels) * 3);
  const double texel_m = size_m / pixels;
  const auto height = [&](int x, int y) {
    const int wx = (x + pixels) % pixels, wy = (y + pixels) % pixels;
    return double(heights[std::size_t(wy) * std::size_t(pixels) + std::size_t(wx)]);
  };
  for (int y = 0; y < pixels; ++y) {
    for (int x = 0; x < pixels; ++x) {
      const double slope_x = (height(x + 1, y) - height(x - 1, y)) / (2 * texel_m);
      const double slope_y = (height(x, y - 1) - height(x, y + 1)) / (2 * texel_m);
      const Vec3 normal = Vec3(-slope_x, -slope_y, 1).normalized();
      const std::size_t i = (std::size_t(y) * std::size_t(pixels) + std::size_t(x)) * 3;
      for (int c = 0; c < 3; ++c) bytes[i + std::size_t(c)] = byte_of(0.5 + 0.5 * normal[c]);
    }
  }
  return bytes;
}

/// Distance to the border of a cell in a grid of `count` cells per repeat, in repeats.
double border_distance(double u, double v, double columns, double rows) {
  const double fu = fraction(u * columns), fv = fraction(v * rows);
  return std::min(std::min(fu, 1 - fu) / columns, std::min(fv, 1 - fv) / rows);
}

Color marble_color(const Color& ground, const Color& vein, std::uint64_t seed, double u, double v) {
  const double wu = u + 0.10 * fractal_noise(seed, u * 3, v * 3, 3, 3, 4);
  const double wv = v + 0.10 * fractal_noise(seed + 5, u * 3, v * 3, 3, 3, 4);
  const double broad = std::abs(fractal_noise(seed + 9, wu * 2, wv * 2, 2, 2, 3));
  const double fine = std::abs(fractal_noise(seed + 13, wu * 5, wv * 5, 5, 5, 3));
  const double cloud = 0.5 + 0.5 * fractal_noise(seed + 17, u * 2, v * 2, 2, 2, 4);
  const double t = 0.75 * std::exp(-broad * 26) + 0.3 * std::exp(-fine * 40) + 0.16 * cloud;
  return blend(ground, vein, t);
}

}  // namespace

TextureSet make_texture_set(Host& host, const char* name, int pixels, double size_m,
                            bool wants_normal,
                            const std::function<Texel(double, double)>& pattern) {
  const auto count = std::size_t(pixels) * std::size_t(pixels);
  std::vector<std::uint8_t> colors(count * 3);
  std::vector<float> heights(wants_normal ? count : 0);
  host.parallel_for(std::size_t(pixels), [&](std::size_t row) {
    for (std::size_t x = 0; x < std::size_t(pixels); ++x) {
      const Texel texel = pattern((double(x) + 0.5) / pixels, 1.0 - (double(row) + 0.5) / pixels);
      const std::size_t i = row * std::size_t(pixels) + x;
      for (int c = 0; c < 3; ++c) colors[i * 3 + std::size_t(c)] = byte_of(double(texel.color[c]));
      if (wants_normal) heights[i] = float(texel.height_m);
    }
  });
  TextureSet set;
  set.size_m = size_m;
  set.color = texture_from(name, "_color", pixels, ColorSpace::Srgb, std::move(colors));
  if (wants_normal) {
    set.normal = texture_from(name, "_normal", pixels, ColorSpace::Linear,
                              normal_bytes(heights, pixels, size_m));
  }
  return set;
}

WoodLook random_wood(Rng& rng) {
  static constexpr std::array<std::array<std::uint32_t, 2>, 7> kSpecies{{
      {0xd8b98c, 0xb48c5c},  // ash
      {0xc79a63, 0x94683a},  // oak
      {0xb5794a, 0x7c4a29},  // cherry
      {0x8a5a3a, 0x54331f},  // mahogany
      {0x6f4c33, 0x3c271a},  // walnut
      {0xe0cba6, 0xc2a274},  // maple
      {0x9c7b58, 0x6a4e35},  // teak, weathered
  }};
  const auto& [light, dark] = kSpecies[rng.index(kSpecies.size())];
  WoodLook look;
  const double shade = rng.uniform(0.92, 1.08);
  look.light = scaled_color(color(light), shade);
  look.dark = scaled_color(color(dark), shade);
  look.contrast = rng.uniform(0.5, 0.9);
  return look;
}

TextureSet make_wood(Host& host, const WoodLook& look, std::uint64_t seed, int pixels) {
  return make_texture_set(host, "wood", pixels, 0.9, false, [&](double u, double v) {
    return Texel{wood_color(look, seed, u, v), 0.0};
  });
}

TextureSet make_planks(Host& host, const WoodLook& look, std::uint64_t seed, int pixels) {
  constexpr int kRows = 16;
  constexpr double kJoint = 0.0011;
  return make_texture_set(host, "planks", pixels, 2.0, true, [&](double u, double v) {
    const int row = int(v * kRows);
    const double shift = lattice_value(seed, row, 1);
    const double along = fraction(u + shift) * 2;  // two boards per repeat
    const int board = int(along);
    const std::uint64_t own = seed + std::uint64_t(row * 2 + board) * 101;
    const double tone = 0.86 + 0.28 * lattice_value(own, 0, 0);
    // Another cut of the log for each board; the board is narrow, so a slice of the wood suffices.
    const double cut = lattice_value(own, 1, 0);
    Color c = wood_color(look, seed + own % 3, fraction(u + cut), fraction(v * 0.9 + cut * 7));
    const double edge_v = std::min(fraction(v * kRows), 1 - fraction(v * kRows)) / kRows;
    const double edge_u = std::min(fraction(along), 1 - fraction(along)) / 2;
    const double gap = smooth_step(kJoint, kJoint * 0.35, std::min(edge_u, edge_v));
    c = blend(scaled_color(c, tone), scaled_color(look.dark, 0.35), 0.85 * gap);
    return Texel{c, -0.0012 * gap};
  });
}

TextureSet make_herringbone(Host& host, const WoodLook& look, std::uint64_t seed, int pixels) {
  // Blocks of 1 x 4 cells on a grid of 16 cells; the pattern repeats after 8 along the diagonal.
  constexpr int kCells = 16;
  constexpr int kLong = 4;
  return make_texture_set(host, "herringbone", pixels, 1.6, true, [&](double u, double v) {
    const double x = u * kCells, y = v * kCells;
    const int ix = int(x), iy = int(y);
    const int phase = ((ix - iy) % (2 * kLong) + 2 * kLong) % (2 * kLong);
    const bool is_level = phase < kLong;
    const int start = is_level ? ix - phase : iy - (2 * kLong - 1 - phase);
    const double along = is_level ? (x - start) / kLong : (y - start) / kLong;
    const double across = is_level ? fraction(y) : fraction(x);
    const int bx = ((is_level ? start : ix) % kCells + kCells) % kCells;
    const int by = ((is_level ? iy : start) % kCells + kCells) % kCells;
    const double tone = 0.84 + 0.32 * lattice_value(seed, bx, by + (is_level ? 0 : 64));
    const double cut = lattice_value(seed + 3, bx, by);
    Color c = wood_color(look, seed, fraction(along * 0.25 + cut), fraction(across / 16 + cut * 5));
    const double edge = std::min(std::min(along, 1 - along) * kLong, std::min(across, 1 - across));
    const double gap = smooth_step(0.022, 0.006, edge);
    c = blend(scaled_color(c, tone), scaled_color(look.dark, 0.35), 0.8 * gap);
    return Texel{c, -0.001 * gap};
  });
}

TextureSet make_tiles(Host& host, const TileLook& look, std::uint64_t seed, int pixels) {
  const int n = look.tiles_per_repeat;
  const double size_m = 0.45 * n;
  const double joint = 0.0022 / size_m;
  return make_texture_set(host, "tiles", pixels, size_m, true, [&, n](double u, double v) {
    const int ix = int(u * n), iy = int(v * n);
    const bool is_other = (ix + iy) % 2 == 1;
    const Color& base = is_other ? look.other : look.tile;
    const std::uint64_t own = seed + std::uint64_t(ix * 31 + iy) * 17;
    Color c = base;
    if (look.is_marble) {
      const double turn = lattice_value(own, 0, 0);
      c = marble_color(base, is_other ? scaled_color(base, 2.2) : scaled_color(base, 0.62), seed,
                       fraction(u + turn), fraction(v + turn * 3));
    } else {
      const double speck = fractal_noise(seed, u * 40, v * 40, 40, 40, 4);
      c = scaled_color(base, 1 + 0.07 * speck + 0.08 * (lattice_value(own, 1, 0) - 0.5));
    }
    const double edge = border_distance(u, v, n, n);
    const double gap = smooth_step(joint * 1.25, joint * 0.8, edge);
    const double cushion = smooth_step(0, joint * 3, edge);
    const double dirt = 0.9 + 0.1 * fractal_noise(seed + 2, u * 30, v * 30, 30, 30, 3);
    c = blend(c, scaled_color(look.joint, dirt), gap);
    return Texel{c, 0.0012 * cushion};
  });
}

TextureSet make_marble(Host& host, const Color& ground, const Color& vein, std::uint64_t seed,
                       int pixels) {
  return make_texture_set(host, "marble", pixels, 1.1, false, [&](double u, double v) {
    return Texel{marble_color(ground, vein, seed, u, v), 0.0};
  });
}

TextureSet make_plaster(Host& host, const Color& paint, double roughness, std::uint64_t seed,
                        int pixels) {
  return make_texture_set(host, "plaster", pixels, 1.5, true, [&](double u, double v) {
    const double broad = fractal_noise(seed, u * 5, v * 5, 5, 5, 4);
    const double grain = fractal_noise(seed + 3, u * 60, v * 60, 60, 60, 3);
    return Texel{scaled_color(paint, 1 + 0.018 * broad + 0.008 * grain),
                 roughness * (0.0012 * broad + 0.0002 * grain)};
  });
}

TextureSet make_wallpaper(Host& host, const Color& ground, const Color& figure, bool is_striped,
                          std::uint64_t seed, int pixels) {
  return make_texture_set(host, "wallpaper", pixels, 0.8, false, [&](double u, double v) {
    const double paper = 1 + 0.02 * fractal_noise(seed, u * 80, v * 80, 80, 80, 2);
    double t = 0.0;
    if (is_striped) {
      const double s = fraction(u * 8);
      t = smooth_step(0.0, 0.02, s) * smooth_step(0.5, 0.48, s);
      t = 0.8 * t + 0.5 * smooth_step(0.03, 0.01, std::abs(s - 0.75));
    } else {
      // A leafy ornament in staggered rows.
      const double row = std::floor(v * 6);
      const double x = fraction(u * 6 + 0.5 * std::fmod(row, 2.0)) - 0.5;
      const double y = fraction(v * 6) - 0.5;
      const double angle = std::atan2(x, y);
      const double radius = std::hypot(x, y);
      const double leaf = 0.30 * std::abs(std::cos(2.5 * angle)) + 0.05;
      t = smooth_step(leaf, leaf - 0.03, radius);
      t = std::max(t, smooth_step(0.012, 0.004, std::abs(radius - 0.43)) * 0.6);
    }
    return Texel{scaled_color(blend(ground, figure, t), paper), 0.0};
  });
}

TextureSet make_fabric(Host& host, const Color& warp, const Color& weft, double relief,
                       std::uint64_t seed, int pixels) {
  constexpr int kThreads = 48;
  const auto pattern = [&](double u, double v) {
    const double wobble = 0.12 * fractal_noise(seed, u * 12, v * 12, 12, 12, 2);
    const double x = u * kThreads + wobble, y = v * kThreads - wobble;
    const int ix = int(std::floor(x)), iy = int(std::floor(y));
    const bool is_warp = ((ix + iy) & 1) == 0;
    const double across = is_warp ? fraction(x) : fraction(y);
    const double along = is_warp ? fraction(y) : fraction(x);
    const double round = std::sin(kPi * across) * (0.55 + 0.45 * std::sin(kPi * along));
    const int thread = is_warp ? (ix + kThreads) % kThreads : (iy + kThreads) % kThreads + 1000;
    const double tone = 1 + relief * 0.22 * (lattice_value(seed, thread, 0) - 0.5);
    const double fuzz = 1 + relief * 0.10 * fractal_noise(seed + 7, u * 96, v * 96, 96, 96, 2);
    const Color& yarn = is_warp ? warp : weft;
    const double shade = 1 - relief * (0.36 - 0.42 * round);
    return Texel{scaled_color(yarn, tone * fuzz * shade), 0.0004 * relief * round};
  };
  return make_texture_set(host, "fabric", pixels, 0.16, relief >= 0.5, pattern);
}

TextureSet make_leather(Host& host, const Color& color, std::uint64_t seed, int pixels) {
  return make_texture_set(host, "leather", pixels, 0.22, true, [&](double u, double v) {
    const double wu = u * 36 + 0.5 * fractal_noise(seed, u * 18, v * 18, 18, 18, 2);
    const double wv = v * 36 + 0.5 * fractal_noise(seed + 1, u * 18, v * 18, 18, 18, 2);
    const CellNoise cell = cell_noise(seed, wu, wv, 36, 36);
    const double crease = smooth_step(0.0, 0.28, cell.second_distance - cell.distance);
    const double wear = fractal_noise(seed + 3, u * 4, v * 4, 4, 4, 4);
    return Texel{scaled_color(color, (0.78 + 0.22 * crease) * (1 + 0.12 * wear)), 0.0005 * crease};
  });
}

TextureSet make_wicker(Host& host, const Color& color, std::uint64_t seed, int pixels) {
  constexpr int kCanes = 16;
  return make_texture_set(host, "wicker", pixels, 0.2, true, [&](double u, double v) {
    const double x = u * kCanes, y = v * kCanes;
    const bool is_over = ((int(x) + int(y)) & 1) == 0;
    const double across = is_over ? fraction(y) : fraction(x);
    const double along = is_over ? fraction(x) : fraction(y);
    const double round = std::sin(kPi * across) * std::sqrt(std::sin(kPi * (0.1 + 0.8 * along)));
    const double fibre = fractal_noise(seed, u * 30, v * 30, 30, 30, 3);
    const double tone = 0.85 + 0.3 * lattice_value(seed, int(x), int(y));
    return Texel{scaled_color(color, tone * (0.35 + 0.65 * round) * (1 + 0.1 * fibre)),
                 0.002 * round};
  });
}

TextureSet make_cardboard(Host& host, std::uint64_t seed, int pixels) {
  return make_texture_set(host, "cardboard", pixels, 0.5, false, [&](double u, double v) {
    const double flutes = std::sin(2 * kPi * u * 70);
    const double fibre = fractal_noise(seed, u * 24, v * 160, 24, 160, 3);
    const double stain = fractal_noise(seed + 4, u * 3, v * 3, 3, 3, 4);
    return Texel{scaled_color(color(0xb98e5f), 1 + 0.012 * flutes + 0.06 * fibre + 0.05 * stain),
                 0.0};
  });
}

namespace {

struct RugLook {
  std::array<Color, 5> palette;
  int kind = 0;
};

RugLook random_rug_look(Rng& rng) {
  static constexpr std::array<std::array<std::uint32_t, 5>, 6> kPalettes{{
      {0x7a1f24, 0x1f2d4d, 0xd9c7a3, 0xb5703a, 0x3d1518},
      {0x23395b, 0xe5dcc5, 0x8d2f2b, 0xc39b5a, 0x152238},
      {0xcfc6b4, 0x8b8578, 0x5d6a63, 0xb38f6a, 0xe9e3d6},
      {0x4f6d62, 0xe7dfca, 0xb86b4b, 0x2c3f3a, 0xd3a75c},
      {0xb9b3a9, 0x4a4a4d, 0xe4e0d8, 0x77736c, 0x2e2e30},
      {0xa4553a, 0xe8d3ac, 0x3c4f52, 0xd59b4a, 0x6e2f22},
  }};
  RugLook look;
  const auto& rgb = kPalettes[rng.index(kPalettes.size())];
  for (std::size_t i = 0; i < look.palette.size(); ++i) look.palette[i] = color(rgb[i]);
  look.kind = int(rng.index(4));
  return look;
}

/// A rosette of eight petals about the origin; how much of a figure covers the point.
double rosette(double x, double y, double radius) {
  const double r = std::hypot(x, y) / radius;
  const double petal = 0.72 + 0.28 * std::cos(8 * std::atan2(y, x));
  return smooth_step(petal, petal - 0.05, r);
}

/// Colour of a rug at x, y in metres-like units from its centre; half sizes hx, hy.
Color rug_field(const RugLook& look, double x, double y, double hx, double hy) {
  const auto& p = look.palette;
  const double ax = std::abs(x), ay = std::abs(y);
  switch (look.kind) {
    case 0: {  // medallion with corner pieces and a scatter of flowers
      Color c = p[0];
      const double fx = fraction(ax * 6 + 0.5 * std::fmod(std::floor(ay * 6), 2.0)) - 0.5;
      const double fy = fraction(ay * 6) - 0.5;
      c = blend(c, p[3], rosette(fx, fy, 0.30));
      c = blend(c, p[2], rosette(fx, fy, 0.12));
      const double lens = std::hypot(x / (0.55 * hx), y / (0.55 * hy)) +
                          0.05 * std::cos(12 * std::atan2(y / hy, x / hx));
      c = blend(c, p[2], smooth_step(1.02, 1.0, lens));
      c = blend(c, p[1], smooth_step(0.96, 0.94, lens));
      c = blend(c, p[3], rosette(x / hx, y / hy, 0.42));
      c = blend(c, p[4], rosette(x / hx, y / hy, 0.30));
      c = blend(c, p[2], rosette(x / hx, y / hy, 0.15));
      const double corner = std::hypot((hx - ax) / (0.5 * hx), (hy - ay) / (0.5 * hy));
      return blend(c, p[1], 0.9 * smooth_step(1.0, 0.98, corner));
    }
    case 1: {  // stripes of different widths
      const double s = fraction((y / hy + 1) * 3.5);
      if (s < 0.36) return p[0];
      if (s < 0.42) return p[2];
      if (s < 0.62) return p[1];
      if (s < 0.68) return p[2];
      const double zig = std::abs(fraction(x * 5) - 0.5) * 0.22;
      return s < 0.78 + zig ? p[3] : p[4];
    }
    case 2: {  // lozenges
      const double d = fraction(ax * 2.2 + ay * 2.2), e = fraction(ax * 2.2 - ay * 2.2 + 8);
      const double line = std::min(std::min(d, 1 - d), std::min(e, 1 - e));
      if (line < 0.05) return p[1];
      return line > 0.32 ? p[3] : p[0];
    }
    default:  // plain field
      return p[0];
  }
}

}  // namespace

std::shared_ptr<const Texture> make_rug(Rng rng, int width, int height) {
  const RugLook look = random_rug_look(rng);
  const std::uint64_t seed = rng.bits();
  const double hx = double(width) / 512, hy = double(height) / 512;
  const double border = 0.2;
  Canvas canvas(width, height, look.palette[0]);
  canvas.shade([&](double px, double py) {
    const double x = px / 256 - hx, y = py / 256 - hy;
    const double edge = std::min(hx - std::abs(x), hy - std::abs(y));
    Color c = rug_field(look, x, y, hx - border, hy - border);
    if (look.kind != 1 && edge < border) {
      const double run = hx - std::abs(x) < hy - std::abs(y) ? y : x;
      const double across = edge / border;
      c = across < 0.12 ? look.palette[4] : look.palette[1];
      if (across > 0.14 && across < 0.22) c = look.palette[2];
      if (across > 0.88) c = look.palette[2];
      const double figure = rosette(fraction(run * 5) - 0.5, (across - 0.55) * 0.9, 0.34);
      c = blend(c, look.palette[3], figure);
      if (look.kind == 3 && across > 0.24) c = look.palette[0];
    }
    // Knots, and the banding of hand-dyed wool.
    const double knots = fractal_noise(seed, px / 2.2, py / 2.2, 4096, 4096, 2);
    const double band = fractal_noise(seed + 1, px / 160, py / 9, 64, 1024, 2);
    return scaled_color(c, 1 + 0.13 * knots + 0.08 * band);
  });
  return canvas.texture("rug");
}

namespace {

Color random_hue(Rng& rng, double saturation, double value) {
  const double h = rng.uniform(0, 6);
  const auto channel = [&](double offset) {
    const double k = std::fmod(h + offset, 6.0);
    return float(value * (1 - saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0)));
  };
  return {channel(5), channel(3), channel(1)};
}

void paint_landscape(Canvas& canvas, Rng& rng) {
  const Color high = random_hue(rng, 0.35, 0.85), low = random_hue(rng, 0.2, 0.98);
  const double w = canvas.width(), h = canvas.height();
  const std::uint64_t seed = rng.bits();
  canvas.shade([&](double x, double y) {
    const double cloud = fractal_noise(seed, x / w * 5, y / h * 12, 64, 64, 5);
    return blend(blend(high, low, y / h * 1.4), Color::Ones(), 0.55 * smooth_step(0, 0.7, cloud));
  });
  canvas.ellipse(w * rng.uniform(0.2, 0.8), h * rng.uniform(0.15, 0.35), w * 0.06, w * 0.06,
                 color(0xfff2c8));
  const Color near = random_hue(rng, 0.6, 0.3);
  for (int layer = 0; layer < 5; ++layer) {
    const double base = h * (0.42 + 0.12 * layer);
    std::vector<Vec2> ridge{{w + 2, h + 2}, {-2, h + 2}};
    for (int i = 0; i <= 60; ++i) {
      const double x = w * i / 60.0;
      const double rise =
          fractal_noise(seed + 7 + std::uint64_t(layer), i / 60.0 * (3 + layer), 0.5, 64, 64, 4);
      ridge.emplace_back(x, base - rise * h * 0.16);
    }
    canvas.polygon(ridge, blend(low, near, 0.25 + 0.18 * layer));
  }
}

void paint_abstract(Canvas& canvas, Rng& rng) {
  const double w = canvas.width(), h = canvas.height();
  const std::array<Color, 4> palette{random_hue(rng, 0.7, 0.75), random_hue(rng, 0.6, 0.5),
                                     random_hue(rng, 0.3, 0.9), color(0x22252a)};
  for (int i = 0; i < 14; ++i) {
    const Color& c = palette[rng.index(palette.size())];
    const Vec2 centre(w * rng.uniform(), h * rng.uniform());
    const double size = w * rng.uniform(0.06, 0.30);
    if (rng.chance(0.4)) {
      canvas.ellipse(centre.x(), centre.y(), size, size, c, rng.uniform(0.6, 1.0));
    } else if (rng.chance(0.6)) {
      canvas.rectangle(centre.x() - size, centre.y() - size / 2, 2 * size, size, c, 0,
                       rng.uniform(0.6, 1.0));
    } else {
      canvas.line(centre, Vec2(w * rng.uniform(), h * rng.uniform()), w * rng.uniform(0.01, 0.04),
                  c);
    }
  }
}

void paint_botanical(Canvas& canvas, Rng& rng) {
  const double w = canvas.width(), h = canvas.height();
  const Color leaf = random_hue(rng, 0.5, 0.42);
  const Vec2 root(w * 0.5, h * 0.92);
  for (int stem = -2; stem <= 2; ++stem) {
    const Vec2 tip(w * (0.5 + 0.16 * stem + rng.uniform(-0.03, 0.03)),
                   h * (0.14 + 0.06 * std::abs(stem)));
    canvas.line(root, tip, w * 0.008, scaled_color(leaf, 0.8));
    for (int i = 2; i < 9; ++i) {
      const Vec2 joint = root + (tip - root) * (i / 9.0);
      const double side = i % 2 == 0 ? 1.0 : -1.0;
      const double angle = std::atan2(tip.x() - root.x(), root.y() - tip.y()) + side * 0.9;
      const Vec2 along(std::sin(angle), -std::cos(angle));
      const Vec2 across(-along.y(), along.x());
      const double length = w * rng.uniform(0.07, 0.11);
      std::vector<Vec2> outline;
      for (int k = 0; k <= 10; ++k) {
        outline.push_back(joint + along * length * k / 10.0 +
                          across * length * 0.22 * std::sin(kPi * k / 10.0));
      }
      for (int k = 9; k > 0; --k) {
        outline.push_back(joint + along * length * k / 10.0 -
                          across * length * 0.22 * std::sin(kPi * k / 10.0));
      }
      canvas.polygon(outline, scaled_color(leaf, rng.uniform(0.8, 1.3)));
    }
  }
}

}  // namespace

std::shared_ptr<const Texture> make_painting(Rng rng, int width, int height) {
  Canvas canvas(width, height, blend(color(0xf1ebdd), random_hue(rng, 0.4, 0.9), 0.25));
  switch (rng.index(3)) {
    case 0:
      paint_landscape(canvas, rng);
      break;
    case 1:
      paint_abstract(canvas, rng);
      break;
    default:
      paint_botanical(canvas, rng);
      break;
  }
  const std::uint64_t seed = rng.bits();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double brush = fractal_noise(seed, x / 24.0, y / 5.0, 1024, 1024, 3);
      canvas.at(x, y) *= float(1 + 0.07 * brush);
    }
  }
  return canvas.texture("painting");
}

std::shared_ptr<const Texture> make_book_spines(Rng rng, int count, int width, int height) {
  static constexpr std::array<const char*, 12> kTitles{"TIDES",  "NORTH",   "GARDEN", "OPTICS",
                                                       "ATLAS",  "RIVERS",  "BREAD",  "STONES",
                                                       "WINTER", "LETTERS", "ORBITS", "MAPS"};
  Canvas canvas(width, height, Color::Ones());
  const double spine = double(width) / count;
  for (int i = 0; i < count; ++i) {
    Rng own = rng.fork(std::uint64_t(i));
    const double x = i * spine;
    const Color cloth = random_hue(own, own.uniform(0.15, 0.55), own.uniform(0.2, 0.62));
    const Color ink = cloth.sum() > 1.6f ? color(0x2a2622) : color(0xe9dfc4);
    canvas.rectangle(x, 0, spine, height, cloth);
    const double band = own.uniform(0.06, 0.14) * height;
    canvas.rectangle(x, band, spine, height * 0.012, ink);
    canvas.rectangle(x, height - band, spine, height * 0.012, ink);
    if (own.chance(0.5)) {
      canvas.rectangle(x, band * 1.4, spine, height * 0.16, scaled_color(cloth, 0.55));
    }
    // Letters one below the other: legible on a narrow spine.
    const std::string_view title = kTitles[own.index(kTitles.size())];
    const double size = std::min(spine * 0.45, 0.5 * height / double(title.size()));
    double y = height * 0.30 + size;
    for (std::size_t k = 0; k < title.size(); ++k) {
      canvas.centred_text(x + spine / 2, y, size * 0.75, title.substr(k, 1), ink);
      y += size;
    }
  }
  return canvas.texture("book_spines");
}

}  // namespace diorama::modelling
