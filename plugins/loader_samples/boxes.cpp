// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <string>

#include "loader_samples/model.h"
#include "modelling/noise.h"

namespace diorama::samples {

using namespace modelling;

namespace {

bool is_wide(int face) { return face == 2 || face == 3; }

/// The back of every carton: a table of figures, small print, a bar code.
void paint_facts(Canvas& c, double x, double y, double w, double h, const Color& ink,
                 std::uint64_t seed) {
  c.rectangle(x + 0.08 * w, y + 0.10 * h, 0.84 * w, 0.42 * h, color(0xfbfaf6), 4);
  c.text(x + 0.13 * w, y + 0.17 * h, 0.045 * h, "NUTRITION", color(0x1c1c1c));
  for (int row = 0; row < 7; ++row) {
    const double top = y + (0.20 + 0.043 * row) * h;
    c.rectangle(x + 0.12 * w, top, 0.76 * w, 1.2, color(0x333333));
    c.small_print(x + 0.13 * w, top + 0.004 * h, 0.42 * w, 0.034 * h, 1, color(0x222222),
                  seed + std::uint64_t(row));
    c.small_print(x + 0.70 * w, top + 0.004 * h, 0.16 * w, 0.034 * h, 1, color(0x222222),
                  seed + 50 + std::uint64_t(row));
  }
  c.small_print(x + 0.08 * w, y + 0.56 * h, 0.84 * w, 0.18 * h, 7, ink, seed + 99);
  c.bar_code(x + 0.55 * w, y + 0.79 * h, 0.37 * w, 0.14 * h, seed);
}

void paint_cracker(Canvas& c, double x, double y, double r, std::uint64_t seed) {
  std::vector<Vec2> outline;
  for (int i = 0; i < 64; ++i) {
    const double a = 2 * kPi * i / 64;
    const double square =
        r * std::pow(std::pow(std::abs(std::cos(a)), 6.0) + std::pow(std::abs(std::sin(a)), 6.0),
                     -1.0 / 6);
    outline.emplace_back(x + (square + 0.03 * r * std::cos(16 * a)) * std::cos(a),
                         y + (square + 0.03 * r * std::cos(16 * a)) * std::sin(a));
  }
  std::vector<Vec2> shadow = outline;
  for (Vec2& p : shadow) p += Vec2(0.08 * r, 0.10 * r);
  c.polygon(shadow, color(0x000000), 0.35);
  c.polygon(outline, color(0xdda758));
  c.ellipse(x - 0.1 * r, y - 0.1 * r, 0.75 * r, 0.75 * r, color(0xebc27a), 0.7);
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j)
      c.ellipse(x + 0.45 * i * r, y + 0.45 * j * r, 0.06 * r, 0.06 * r, color(0x9a6a2c));
  }
  for (int i = 0; i < 24; ++i) {
    c.ellipse(x + 0.8 * r * (2 * lattice_value(seed, i, 0) - 1),
              y + 0.8 * r * (2 * lattice_value(seed, i, 1) - 1), 0.02 * r, 0.02 * r,
              color(0xfff8e8), 0.9);
  }
}

Model cracker_box(Host&, Rng) {
  const Color red = color(0xb3202a), cream = color(0xf5e8cc);
  return make_carton({0.158, 0.060, 0.210}, 0.0018, red, 0.42,
                     [&](Canvas& c, int face, double x, double y, double w, double h) {
                       if (face == 2) {
                         c.rectangle(x, y + 0.07 * h, w, 0.26 * h, cream);
                         c.rectangle(x, y + 0.345 * h, w, 0.012 * h, color(0xe3b23c));
                         c.centred_text(x + w / 2, y + 0.22 * h, 0.105 * h, "CRISPINO", red, 0.2);
                         c.centred_text(x + w / 2, y + 0.30 * h, 0.038 * h, "GOLDEN CRACKERS",
                                        color(0x5a2a1c));
                         paint_cracker(c, x + 0.34 * w, y + 0.58 * h, 0.19 * w, 3);
                         paint_cracker(c, x + 0.66 * w, y + 0.66 * h, 0.19 * w, 5);
                         paint_cracker(c, x + 0.42 * w, y + 0.80 * h, 0.17 * w, 9);
                         c.ellipse(x + 0.84 * w, y + 0.46 * h, 0.10 * w, 0.10 * w, color(0xe3b23c));
                         c.centred_text(x + 0.84 * w, y + 0.475 * h, 0.03 * h, "NEW", red, 0.18);
                         c.text(x + 0.06 * w, y + 0.96 * h, 0.026 * h, "NET 411 G", cream);
                       } else if (face == 3) {
                         paint_facts(c, x, y, w, h, cream, 11);
                       } else if (face < 2) {
                         c.rectangle(x, y + 0.07 * h, w, 0.26 * h, cream);
                         c.centred_text(x + w / 2, y + 0.205 * h, 0.05 * h, "CRISPINO", red, 0.18);
                         paint_cracker(c, x + 0.5 * w, y + 0.55 * h, 0.3 * w, 4);
                         c.small_print(x + 0.12 * w, y + 0.72 * h, 0.76 * w, 0.2 * h, 8, cream, 21);
                       } else {
                         c.centred_text(x + w / 2, y + 0.62 * h, 0.26 * h, "CRISPINO", cream, 0.18);
                       }
                     });
}

Model sugar_box(Host&, Rng) {
  const Color yellow = color(0xf2c230), blue = color(0x1f3f86), white = color(0xfaf8f2);
  return make_carton(
      {0.089, 0.038, 0.175}, 0.0015, yellow, 0.45,
      [&](Canvas& c, int face, double x, double y, double w, double h) {
        if (is_wide(face)) {
          c.rectangle(x, y, w, 0.16 * h, blue);
          c.rectangle(x, y + 0.78 * h, w, 0.22 * h, white);
          const std::vector<Vec2> wave{{x, y + 0.80 * h},           {x + w * 0.3, y + 0.72 * h},
                                       {x + 0.7 * w, y + 0.81 * h}, {x + w, y + 0.74 * h},
                                       {x + w, y + 0.9 * h},        {x, y + 0.9 * h}};
          c.polygon(wave, white);
          c.centred_text(x + w / 2, y + 0.11 * h, 0.055 * h, "ALBA", white, 0.2);
          c.centred_text(x + w / 2, y + 0.36 * h, 0.11 * h, "SUGAR", blue, 0.2);
          c.centred_text(x + w / 2, y + 0.44 * h, 0.035 * h, "PURE CANE", color(0xa3342a), 0.16);
          for (int i = 0; i < 9; ++i) {
            const double px = x + w * (0.2 + 0.6 * lattice_value(7, i, 0)),
                         py = y + h * (0.55 + 0.16 * lattice_value(7, i, 1));
            c.rectangle(px, py, 0.08 * w, 0.08 * w, white, 2);
            c.rectangle(px + 0.012 * w, py + 0.012 * w, 0.056 * w, 0.056 * w, color(0xe6e6e8), 2);
          }
          if (face == 3) c.bar_code(x + 0.3 * w, y + 0.83 * h, 0.4 * w, 0.11 * h, 4);
          if (face == 2) c.centred_text(x + w / 2, y + 0.93 * h, 0.035 * h, "NET 500 G", blue);
        } else if (face < 2) {
          c.rectangle(x, y, w, 0.16 * h, blue);
          c.small_print(x + 0.12 * w, y + 0.3 * h, 0.76 * w, 0.4 * h, 14, blue, 31);
        } else {
          c.centred_text(x + w / 2, y + 0.66 * h, 0.3 * h, "ALBA", blue, 0.2);
        }
      });
}

Model pudding_box(Host&, Rng) {
  const Color brown = color(0x4a2a1d), cream = color(0xf3e2c4), red = color(0xc2332c);
  return make_carton({0.110, 0.035, 0.089}, 0.0012, brown, 0.38,
                     [&](Canvas& c, int face, double x, double y, double w, double h) {
                       if (is_wide(face)) {
                         c.ellipse(x + 0.5 * w, y + 0.74 * h, 0.34 * w, 0.20 * h, color(0xe9e7e2));
                         c.ellipse(x + 0.5 * w, y + 0.70 * h, 0.29 * w, 0.15 * h, color(0x6b3d27));
                         c.ellipse(x + 0.46 * w, y + 0.665 * h, 0.12 * w, 0.07 * h, cream);
                         c.ellipse(x + 0.46 * w, y + 0.62 * h, 0.035 * w, 0.035 * w, red);
                         c.rectangle(x + 0.08 * w, y + 0.1 * h, 0.84 * w, 0.27 * h, red, 8);
                         c.centred_text(x + w / 2, y + 0.295 * h, 0.14 * h, "VELLUTO", cream, 0.18);
                         c.centred_text(x + w / 2, y + 0.47 * h, 0.055 * h, "CHOCOLATE PUDDING",
                                        cream, 0.15);
                         if (face == 3)
                           c.bar_code(x + 0.68 * w, y + 0.72 * h, 0.26 * w, 0.2 * h, 8);
                       } else if (face >= 4) {
                         c.centred_text(x + w / 2, y + 0.68 * h, 0.36 * h, "VELLUTO", cream, 0.18);
                       } else {
                         c.small_print(x + 0.14 * w, y + 0.2 * h, 0.72 * w, 0.6 * h, 9, cream, 41);
                       }
                     });
}

Model gelatin_box(Host&, Rng) {
  const Color white = color(0xf7f6f3), red = color(0xd02b3c), pink = color(0xf29aa6);
  return make_carton(
      {0.085, 0.028, 0.073}, 0.0012, white, 0.38,
      [&](Canvas& c, int face, double x, double y, double w, double h) {
        if (is_wide(face)) {
          c.rectangle(x, y + 0.45 * h, w, 0.55 * h, red);
          for (int i = 0; i < 6; ++i) {
            const double px = x + w * (0.12 + 0.15 * i), r = 0.06 * w;
            c.ellipse(px, y + 0.72 * h + 0.06 * h * std::sin(2.0 * i), r, r * 1.15, pink);
            c.ellipse(px, y + 0.66 * h + 0.06 * h * std::sin(2.0 * i), r * 0.5, r * 0.3,
                      color(0x3f8a45));
          }
          c.centred_text(x + w / 2, y + 0.34 * h, 0.2 * h, "GELA", red, 0.2);
          c.centred_text(x + w / 2, y + 0.56 * h, 0.06 * h, "STRAWBERRY", white, 0.16);
        } else if (face < 4) {
          c.rectangle(x, y + 0.45 * h, w, 0.55 * h, red);
          c.small_print(x + 0.1 * w, y + 0.5 * h, 0.8 * w, 0.4 * h, 7, white, 5);
        } else {
          c.centred_text(x + w / 2, y + 0.68 * h, 0.36 * h, "GELA", red, 0.2);
        }
      });
}

Model wood_block(Host& host, Rng rng) {
  MeshBuilder builder;
  const TextureSet wood = make_wood(host, {color(0xcfa56e), color(0x9c6f3f), 0.7}, rng.bits(), 512);
  builder.begin(Affine::Identity(), {0, 1 / wood.size_m, Vec2(0.3, 0.1)});
  add_box(builder, Vec3(0.085, 0.085, 0.200), 0.003, Axis::Z, 3);
  return finish(builder, {make_textured("wood", wood, 0.65)});
}

Model foam_brick(Host& host, Rng rng) {
  const std::uint64_t seed = rng.bits();
  const TextureSet foam =
      make_texture_set(host, "foam", 256, 0.08, true, [seed](double u, double v) {
        const CellNoise cell = cell_noise(seed, u * 40, v * 40, 40, 40);
        const double pore =
            std::clamp(1 - 2.2 * cell.distance, 0.0, 1.0) * (cell.cell % 3 == 0 ? 1 : 0.3);
        return Texel{color(0xa8392f) * float(1 - 0.35 * pore), -0.0006 * pore};
      });
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 1 / foam.size_m});
  add_box(builder, Vec3(0.075, 0.050, 0.050), 0.0025, Axis::X, 3);
  return finish(builder, {make_textured("foam", foam, 0.95)});
}

Model puzzle_cube(Host&, Rng rng) {
  const std::array<Color, 6> faces{color(0xc41e2a), color(0xf07f1e), color(0x1b57c4),
                                   color(0x1f9a4a), color(0xf3f3f0), color(0xf2d21f)};
  MeshBuilder builder;
  constexpr double kSize = 0.057, kCubie = kSize / 3;
  builder.begin(Affine::Identity(), {0, 1.0});
  add_box(builder, Vec3::Constant(kSize), 0.0022, Axis::X, 3);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      for (int i = -1; i <= 1; ++i) {
        for (int j = -1; j <= 1; ++j) {
          Vec3 place = Vec3::Zero(), size = Vec3::Constant(kCubie * 0.86);
          place[axis] = sign * (kSize / 2 - 0.0001);
          place[(axis + 1) % 3] = i * kCubie * 0.985;
          place[(axis + 2) % 3] = j * kCubie * 0.985;
          size[axis] = 0.0012;
          builder.begin(at(place), {std::uint16_t(1 + rng.index(6)), 1.0});
          add_box(builder, size, 0.0005, Axis::X);
        }
      }
    }
  }
  std::vector<MaterialPtr> materials{make_plain("body", color(0x17181a), 0.4)};
  for (std::size_t k = 0; k < faces.size(); ++k)
    materials.push_back(make_plain("sticker_" + std::to_string(k), faces[k], 0.3));
  return finish(builder, std::move(materials));
}

constexpr ModelKind kBoxes[] = {
    {"003_cracker_box", 0.411, cracker_box}, {"004_sugar_box", 0.514, sugar_box},
    {"008_pudding_box", 0.187, pudding_box}, {"009_gelatin_box", 0.097, gelatin_box},
    {"036_wood_block", 0.729, wood_block},   {"061_foam_brick", 0.028, foam_brick},
    {"077_rubiks_cube", 0.094, puzzle_cube},
};

}  // namespace

std::span<const ModelKind> boxes() { return kBoxes; }

}  // namespace diorama::samples
