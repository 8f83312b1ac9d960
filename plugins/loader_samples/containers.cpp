// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "loader_samples/model.h"
#include "modelling/noise.h"

namespace diorama::samples {

using namespace modelling;

namespace {

constexpr int kRound = 72;

const Color kTin = color(0xc9cacb);

MaterialPtr tin() { return make_plain("tin", kTin, 0.28, 1.0); }

/// A tin can with rolled rims; the label runs around between them.
void add_can(MeshBuilder& builder, double radius, double height) {
  const double rim = 0.0045;
  const std::array<ProfilePoint, 8> foot{{{0, 0.0015},
                                          {radius - 0.004, 0.0015},
                                          {radius - 0.003, 0},
                                          {radius - 0.0006, 0},
                                          {radius, 0.0012},
                                          {radius, rim - 0.001},
                                          {radius - 0.0012, rim},
                                          {0, rim}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, foot, kRound, 0.9);
  builder.begin(at(0, 0, height) * scaled(1, 1, -1), {0, 1.0});
  std::array<ProfilePoint, 8> head = foot;
  head[0].z = 0.0035;
  head[1] = {radius - 0.0042, 0.0035};
  add_lathe(builder, head, kRound, 0.9);
  // The label, with a cap of its own inside each rim so that it is closed.
  const double r = radius - 0.0008;
  builder.begin(Affine::Identity(), {1, 1.0});
  const std::array<ProfilePoint, 2> wall{{{r, rim - 0.0005}, {r, height - rim + 0.0005}}};
  add_lathe_unit_uv(builder, wall, kRound, 0, 1);
  builder.begin(Affine::Identity(), {0, 1.0});
  const std::array<ProfilePoint, 2> low{{{0, rim - 0.0005}, {r, rim - 0.0005}}};
  const std::array<ProfilePoint, 2> high{{{r, height - rim + 0.0005}, {0, height - rim + 0.0005}}};
  add_lathe(builder, low, kRound);
  add_lathe(builder, high, kRound);
}

Model coffee_can(Host&, Rng) {
  MeshBuilder builder;
  add_can(builder, 0.051, 0.139);
  // A plastic lid.
  builder.begin(at(0, 0, 0.133), {2, 1.0});
  const std::array<ProfilePoint, 7> lid{{{0, 0.0062},
                                         {0.0504, 0.0062},
                                         {0.0504, 0},
                                         {0.0525, 0},
                                         {0.0528, 0.006},
                                         {0.0515, 0.0075},
                                         {0, 0.0075}}};
  add_lathe(builder, lid, kRound, 0.9);
  const Color blue = color(0x16326b), white = color(0xf4f1e8), gold = color(0xd7a93b);
  Canvas c(1024, 440, blue);
  for (const double x : {256.0, 768.0}) {
    c.ellipse(x, 180, 190, 135, white);
    c.ellipse(x, 180, 178, 124, blue);
    c.centred_text(x, 168, 46, "ROASTER", white, 0.2);
    c.centred_text(x, 220, 22, "GROUND COFFEE", gold, 0.18);
    for (int i = 0; i < 7; ++i) {
      const double bx = x - 130 + 43 * i, by = 350 + 12 * std::sin(1.7 * i);
      c.ellipse(bx, by, 24, 17, color(0x5b3420));
      c.line({bx - 18, by + 4}, {bx + 18, by - 4}, 3, color(0x2c170d));
    }
  }
  c.rectangle(0, 12, 1024, 10, gold);
  c.rectangle(0, 418, 1024, 10, gold);
  c.bar_code(470, 290, 90, 70, 6);
  c.small_print(455, 60, 115, 200, 14, white, 3);
  return finish(builder, {tin(), make_picture_material("label", c.texture("label"), 0.35),
                          make_plain("lid", color(0x1a2f5c), 0.45)});
}

Model soup_can(Host&, Rng) {
  MeshBuilder builder;
  add_can(builder, 0.033, 0.101);
  const Color red = color(0xc3272b), white = color(0xf5f0e4);
  Canvas c(1024, 500, red);
  c.rectangle(0, 250, 1024, 250, white);
  for (const double x : {256.0, 768.0}) {
    c.centred_text(x, 150, 62, "ROSSO", white, 0.22);
    c.centred_text(x, 210, 28, "SINCE 1887", color(0xf0c9a0));
    c.ellipse(x, 250, 62, 62, color(0xd8a93c));
    c.ellipse(x, 250, 50, 50, color(0xc93a2b));
    c.ellipse(x - 14, 236, 16, 12, color(0xe87a66));
    c.line({x, 205}, {x - 20, 190}, 8, color(0x3f7d3c));
    c.line({x, 205}, {x + 20, 190}, 8, color(0x3f7d3c));
    c.centred_text(x, 380, 46, "TOMATO", red, 0.18);
    c.centred_text(x, 440, 40, "SOUP", red, 0.18);
  }
  c.bar_code(468, 330, 90, 110, 9);
  c.small_print(20, 300, 70, 160, 14, color(0x554040), 5);
  return finish(builder, {tin(), make_picture_material("label", c.texture("label"), 0.4)});
}

Model tuna_can(Host&, Rng) {
  MeshBuilder builder;
  add_can(builder, 0.0425, 0.033);
  const Color blue = color(0x1d6a9e), white = color(0xf3f4f2);
  Canvas c(1024, 128, blue);
  for (int i = 0; i < 3; ++i) {
    const double x = 170 + 341.0 * i;
    c.centred_text(x, 66, 44, "TONNO", white, 0.2);
    c.centred_text(x, 100, 20, "IN OLIVE OIL", color(0xf2d36b));
    c.ellipse(x + 145, 60, 32, 16, color(0xbfd6e2));
    const std::array<Vec2, 3> tail{Vec2(x + 172, 60), Vec2(x + 190, 44), Vec2(x + 190, 76)};
    c.polygon(tail, color(0xbfd6e2));
  }
  return finish(builder, {tin(), make_picture_material("label", c.texture("label"), 0.35)});
}

/// Points of a rounded rectangle loop; the loft below joins such loops.
std::vector<Vec2> oval(double half_x, double half_y, double exponent, int count) {
  std::vector<Vec2> loop;
  for (int i = 0; i < count; ++i) {
    const double a = 2 * kPi * i / count;
    const double c = std::cos(a), s = std::sin(a);
    loop.emplace_back(half_x * std::copysign(std::pow(std::abs(c), 2 / exponent), c),
                      half_y * std::copysign(std::pow(std::abs(s), 2 / exponent), s));
  }
  return loop;
}

/// A level section of a bottle.
struct Section {
  double z;
  double half_x;
  double half_y;
  double exponent = 2.0;
};

/// A closed skin over level sections from the lowest to the highest; uvs once around (front at the
/// middle of the picture) and 0..1 between the two heights of the label.
void add_loft(MeshBuilder& builder, std::span<const Section> sections, double v_from, double v_to) {
  constexpr int kCount = 80;
  const auto ring = [&](const Section& s) { return oval(s.half_x, s.half_y, s.exponent, kCount); };
  std::vector<std::vector<Vec2>> rings;
  for (const Section& s : sections) rings.push_back(ring(s));
  std::uint32_t first = 0;
  for (std::size_t k = 0; k < sections.size(); ++k) {
    for (int i = 0; i <= kCount; ++i) {
      const auto at_i = [&](std::size_t row, int col) {
        const Vec2& p = rings[row][std::size_t((col + kCount) % kCount)];
        return Vec3(p.x(), p.y(), sections[row].z);
      };
      const std::size_t below = k == 0 ? 0 : k - 1, above = std::min(k + 1, sections.size() - 1);
      const Vec3 around = at_i(k, i + 1) - at_i(k, i - 1);
      const Vec3 up = at_i(above, i) - at_i(below, i);
      // The angle runs from +x; the front (-y) shall be the middle of the picture.
      const double u = double(i) / kCount + 0.75;
      const double v = (sections[k].z - v_from) / (v_to - v_from);
      const std::uint32_t id = builder.add_vertex(at_i(k, i), around.cross(up), Vec2(u, v));
      if (k == 0 && i == 0) first = id;
    }
  }
  const auto stride = std::uint32_t(kCount) + 1;
  for (std::uint32_t k = 0; k + 1 < sections.size(); ++k) {
    for (std::uint32_t i = 0; i < std::uint32_t(kCount); ++i) {
      const std::uint32_t v = first + k * stride + i;
      builder.add_quad(v, v + 1, v + stride + 1, v + stride);
    }
  }
  for (const bool is_top : {false, true}) {
    const std::size_t k = is_top ? sections.size() - 1 : 0;
    const Vec3 normal(0, 0, is_top ? 1 : -1);
    const std::uint32_t hub =
        builder.add_vertex(Vec3(0, 0, sections[k].z), normal, Vec2(0.02, 0.02));
    for (const Vec2& p : rings[k])
      builder.add_vertex(Vec3(p.x(), p.y(), sections[k].z), normal, Vec2(0.02, 0.02));
    for (std::uint32_t i = 0; i < std::uint32_t(kCount); ++i) {
      const std::uint32_t a = hub + 1 + i, b = hub + 1 + (i + 1) % std::uint32_t(kCount);
      if (is_top) {
        builder.add_triangle(hub, a, b);
      } else {
        builder.add_triangle(hub, b, a);
      }
    }
  }
}

/// Fills in sections by a smooth curve.
std::vector<Section> smooth_sections(std::span<const Section> knots, int steps) {
  std::vector<Vec3> sizes, heights;
  for (const Section& s : knots) {
    sizes.emplace_back(s.half_x, s.half_y, s.exponent);
    heights.emplace_back(s.z, 0, 0);
  }
  const auto fine = smooth_path(sizes, steps);
  std::vector<Section> result;
  const auto spans = knots.size() - 1;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    const std::size_t span = std::min(spans - 1, i / std::size_t(steps));
    const double t = double(i - span * std::size_t(steps)) / steps;
    result.push_back({std::lerp(knots[span].z, knots[span + 1].z, t), std::max(0.001, fine[i].x()),
                      std::max(0.001, fine[i].y()), std::max(2.0, fine[i].z())});
  }
  return result;
}

Model mustard_bottle(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 1.0});
  const std::array<Section, 9> body{{{0, 0.036, 0.022, 3},
                                     {0.004, 0.044, 0.027, 3},
                                     {0.03, 0.0475, 0.029, 2.6},
                                     {0.09, 0.0475, 0.029, 2.4},
                                     {0.115, 0.044, 0.0275, 2.3},
                                     {0.135, 0.033, 0.023, 2.1},
                                     {0.148, 0.020, 0.018, 2},
                                     {0.152, 0.0165, 0.0165, 2},
                                     {0.158, 0.0165, 0.0165, 2}}};
  add_loft(builder, smooth_sections(body, 6), 0.0, 0.158);
  builder.begin(at(0, 0, 0.157), {1, 1.0});
  const std::array<ProfilePoint, 9> cap{{{0, 0},
                                         {0.0175, 0},
                                         {0.018, 0.002},
                                         {0.017, 0.012},
                                         {0.0085, 0.018},
                                         {0.0055, 0.028},
                                         {0.0035, 0.032},
                                         {0.0033, 0.033},
                                         {0, 0.033}}};
  add_lathe(builder, cap, 48, 0.7);
  const Color yellow = color(0xf0b91a), red = color(0xb8261f), white = color(0xfaf6e6);
  Canvas c(1024, 512, yellow);
  for (const double x : {512.0, 0.0, 1024.0}) {
    c.rectangle(x - 190, 190, 380, 230, red, 40);
    c.rectangle(x - 178, 202, 356, 206, white, 34);
    c.centred_text(x, 300, 58, "SENAPE", red, 0.2);
    c.centred_text(x, 352, 32, "MUSTARD", color(0x3a5a2c), 0.18);
    c.ellipse(x, 392, 120, 4, red);
    if (x == 0.0 || x == 1024.0) c.small_print(x - 110, 365, 220, 40, 4, color(0x444444), 7);
  }
  return finish(builder,
                {make_picture_material("plastic_label", c.texture("label"), 0.3, Wrap::Repeat),
                 make_plain("cap", yellow, 0.35)});
}

Model bleach_bottle(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 1.0});
  const std::array<Section, 9> body{{{0, 0.040, 0.026, 4},
                                     {0.005, 0.0475, 0.031, 4},
                                     {0.03, 0.049, 0.0325, 3.4},
                                     {0.12, 0.049, 0.0325, 3.2},
                                     {0.150, 0.046, 0.031, 2.8},
                                     {0.180, 0.031, 0.025, 2.3},
                                     {0.205, 0.0165, 0.0165, 2},
                                     {0.212, 0.0145, 0.0145, 2},
                                     {0.220, 0.0145, 0.0145, 2}}};
  add_loft(builder, smooth_sections(body, 6), 0.0, 0.220);
  builder.begin(at(0, 0, 0.217), {1, 1.0});
  std::vector<ProfilePoint> cap{{0, 0}, {0.0175, 0}, {0.0178, 0.002}};
  for (const ProfilePoint& p :
       {ProfilePoint{0.0172, 0.028}, ProfilePoint{0.0155, 0.033}, ProfilePoint{0, 0.033}})
    cap.push_back(p);
  add_lathe(builder, cap, 48, 0.6);
  for (int i = 0; i < 24; ++i) {
    const double a = 2 * kPi * i / 24;
    builder.begin(at(0.0172 * std::cos(a), 0.0172 * std::sin(a), 0.231) * turned_z(a), {1, 1.0});
    add_box(builder, Vec3(0.0016, 0.0016, 0.022), 0.0006, Axis::Z);
  }
  const Color white = color(0xf1f3f2), blue = color(0x1c4fa0), green = color(0x2f9a67);
  Canvas c(1024, 768, white);
  for (const double x : {512.0, 0.0, 1024.0}) {
    c.rectangle(x - 215, 300, 430, 380, blue, 20);
    c.rectangle(x - 215, 300, 430, 70, green, 20);
    c.centred_text(x, 352, 36, "LEMON SCENT", white, 0.16);
    c.centred_text(x, 470, 74, "CLARO", white, 0.22);
    c.centred_text(x, 525, 34, "BLEACH CLEANSER", color(0xf2d94a), 0.16);
    for (int i = 0; i < 8; ++i) {
      const double a = 2 * kPi * i / 8;
      c.line({x + 26 * std::cos(a), 595 + 26 * std::sin(a)},
             {x + 52 * std::cos(a), 595 + 52 * std::sin(a)}, 7, color(0xf2d94a));
    }
    c.ellipse(x, 595, 20, 20, color(0xf2d94a));
  }
  c.small_print(250, 400, 40, 250, 20, color(0x4a4d52), 12);
  return finish(builder,
                {make_picture_material("plastic_label", c.texture("label"), 0.35, Wrap::Repeat),
                 make_plain("cap", blue, 0.4)});
}

Model meat_can(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 1.0});
  const std::array<Section, 6> body{{{0.003, 0.0475, 0.0240, 5},
                                     {0.006, 0.0480, 0.0245, 5},
                                     {0.03, 0.0480, 0.0245, 5},
                                     {0.06, 0.0480, 0.0245, 5},
                                     {0.076, 0.0480, 0.0245, 5},
                                     {0.079, 0.0475, 0.0240, 5}}};
  add_loft(builder, body, 0.003, 0.079);
  for (const double z : {0.0, 0.078}) {
    builder.begin(at(0, 0, z), {1, 1.0});
    const std::array<Section, 4> rim{{{0, 0.0478, 0.0243, 5},
                                      {0.0012, 0.0490, 0.0255, 5},
                                      {0.0030, 0.0490, 0.0255, 5},
                                      {0.0042, 0.0478, 0.0243, 5}}};
    add_loft(builder, rim, 0, 1);
  }
  // The pull ring.
  builder.begin(at(-0.012, 0, 0.0835), {1, 1.0});
  std::vector<Vec3> loop;
  for (int i = 0; i <= 28; ++i) {
    const double a = 2 * kPi * (0.02 + 0.96 * i / 28);
    loop.emplace_back(0.013 * std::cos(a), 0.009 * std::sin(a), 0.0);
  }
  add_tube(builder, loop, 0.0012, 10);
  builder.begin(at(0.004, 0, 0.0826), {1, 1.0});
  add_box(builder, Vec3(0.012, 0.007, 0.0024), 0.0008, Axis::X);
  const Color navy = color(0x1b2f66), yellow = color(0xf0c62e), white = color(0xf6f3ea);
  Canvas c(1024, 300, navy);
  for (const double x : {512.0, 0.0, 1024.0}) {
    c.rectangle(x - 170, 26, 340, 110, yellow, 14);
    c.centred_text(x, 112, 66, "PRADO", navy, 0.22);
    c.centred_text(x, 176, 28, "CHOPPED HAM", white, 0.16);
    c.ellipse(x, 234, 110, 36, color(0xe58f83));
    c.ellipse(x - 20, 226, 60, 18, color(0xf0aea4));
  }
  c.bar_code(215, 170, 80, 90, 13);
  return finish(builder,
                {make_picture_material("label", c.texture("label"), 0.32, Wrap::Repeat), tin()});
}

Model bowl(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const std::array<ProfilePoint, 6> outer{{{0.033, 0},
                                           {0.035, 0.004},
                                           {0.052, 0.010},
                                           {0.069, 0.026},
                                           {0.0775, 0.044},
                                           {0.0795, 0.053}}};
  add_lathe(builder, vessel(smooth_profile(outer, 6), 0.0038), kRound, 0.8);
  return finish(builder, {make_plain("glazed_red", color(0xb5271f), 0.18)});
}

Model plate(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const std::array<ProfilePoint, 6> outer{
      {{0.075, 0}, {0.08, 0.003}, {0.09, 0.006}, {0.105, 0.012}, {0.122, 0.020}, {0.1305, 0.023}}};
  add_lathe(builder, vessel(smooth_profile(outer, 5), 0.0036), kRound, 0.8);
  return finish(builder, {make_plain("glazed_blue", color(0x2f62a8), 0.2)});
}

void add_handle(MeshBuilder& builder, double x, double z_low, double z_high, double reach,
                double thick) {
  const double z = (z_low + z_high) / 2, h = (z_high - z_low) / 2;
  const std::array<Vec3, 7> ear{Vec3(x - 0.003, 0, z_high),
                                Vec3(x + reach * 0.45, 0, z_high + 0.002),
                                Vec3(x + reach * 0.92, 0, z + h * 0.55),
                                Vec3(x + reach, 0, z),
                                Vec3(x + reach * 0.88, 0, z - h * 0.55),
                                Vec3(x + reach * 0.42, 0, z_low - 0.002),
                                Vec3(x - 0.003, 0, z_low)};
  std::vector<PathPoint> path;
  for (const Vec3& p : smooth_path(ear, 6)) path.push_back({p, thick, thick * 0.62});
  add_sweep(builder, path, 18, Vec3::UnitX(), 2.6);
}

Model mug(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const std::array<ProfilePoint, 6> outer{{{0.034, 0},
                                           {0.0385, 0.003},
                                           {0.0405, 0.012},
                                           {0.0405, 0.05},
                                           {0.0405, 0.075},
                                           {0.0408, 0.081}}};
  add_lathe(builder, vessel(smooth_profile(outer, 5), 0.0036), kRound, 0.8);
  builder.begin(Affine::Identity(), {});
  add_handle(builder, 0.0405, 0.019, 0.064, 0.034, 0.0068);
  return finish(builder, {make_plain("glazed_white_red", color(0xb92f23), 0.15)});
}

Model pitcher(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const std::array<ProfilePoint, 5> outer{
      {{0.045, 0}, {0.049, 0.004}, {0.050, 0.03}, {0.053, 0.18}, {0.055, 0.234}}};
  add_lathe(builder, vessel(smooth_profile(outer, 5), 0.0028), kRound, 0.8);
  builder.begin(Affine::Identity(), {});
  add_handle(builder, 0.0525, 0.06, 0.205, 0.05, 0.0095);
  return finish(builder, {make_plain("blue_plastic", color(0x2d6aa8), 0.32)});
}

TextureSet fruit_skin(Host& host, const Color& a, const Color& b, double speckle,
                      std::uint64_t seed) {
  return make_texture_set(host, "skin", 256, 0.25, false, [=](double u, double v) {
    const double broad = 0.5 + 0.6 * fractal_noise(seed, u * 3, v * 3, 3, 3, 4);
    const double streak = 0.5 + 0.5 * fractal_noise(seed + 1, u * 60, v * 4, 60, 4, 2);
    const CellNoise spot = cell_noise(seed + 2, u * 26, v * 26, 26, 26);
    const double dot = spot.distance < 0.13 ? speckle : 0.0;
    return Texel{blend(blend(a, b, 0.75 * broad + 0.25 * streak), color(0xf4e3b0), dot), 0.0};
  });
}

/// A round fruit with a dimple at both ends and a stem.
Model round_fruit(const TextureSet& skin, double radius, double height, double dimple, double pear,
                  double roughness, bool has_stem) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 1 / skin.size_m});
  std::vector<ProfilePoint> profile;
  constexpr int kSteps = 40;
  for (int i = 0; i <= kSteps; ++i) {
    const double a = kPi * i / kSteps;
    const double s = std::sin(a), up = -std::cos(a);
    const double hollow = dimple * std::exp(-18 * s * s) * (up > 0 ? 1.0 : 0.6);
    const double neck = 1 - pear * std::max(0.0, up) * (0.5 + 0.5 * std::max(0.0, up));
    profile.push_back({i == 0 || i == kSteps ? 0.0 : radius * s * neck,
                       height / 2 * up - (up > 0 ? hollow : -hollow)});
  }
  add_lathe(builder, profile, 56, 3.0);
  if (has_stem) {
    const double foot = height / 2 - dimple - 0.004;
    const std::array<PathPoint, 4> stem{PathPoint{Vec3(0, 0, foot), 0.0014, 0.0014},
                                        PathPoint{Vec3(0.001, 0, foot + 0.008), 0.0012, 0.0012},
                                        PathPoint{Vec3(0.003, 0, foot + 0.014), 0.0014, 0.0014},
                                        PathPoint{Vec3(0.004, 0, foot + 0.0165), 0.0018, 0.0018}};
    builder.begin(Affine::Identity(), {1, 1.0});
    add_sweep(builder, stem, 10);
  }
  return finish(builder,
                {make_textured("skin", skin, roughness), make_plain("stem", color(0x5a4326), 0.8)});
}

Model apple(Host& host, Rng rng) {
  return round_fruit(fruit_skin(host, color(0x9d1c1f), color(0xc8492f), 0.5, rng.bits()), 0.0375,
                     0.070, 0.009, 0.0, 0.28, true);
}
Model orange(Host& host, Rng rng) {
  const std::uint64_t seed = rng.bits();
  const TextureSet skin =
      make_texture_set(host, "peel", 256, 0.06, true, [seed](double u, double v) {
        const CellNoise pore = cell_noise(seed, u * 40, v * 40, 40, 40);
        const double pit = std::clamp(1 - 2.5 * pore.distance, 0.0, 1.0);
        return Texel{color(0xe9871c) * float(1 - 0.10 * pit), -0.00022 * pit};
      });
  return round_fruit(skin, 0.0365, 0.071, 0.002, 0.0, 0.38, false);
}
Model pear(Host& host, Rng rng) {
  return round_fruit(fruit_skin(host, color(0x9aa53c), color(0xc6b449), 0.35, rng.bits()), 0.0345,
                     0.098, 0.005, 0.55, 0.4, true);
}
Model lemon(Host& host, Rng rng) {
  const TextureSet skin = fruit_skin(host, color(0xe8c522), color(0xf2d94a), 0.0, rng.bits());
  MeshBuilder builder;
  builder.begin(turned_y(kPi / 2), {0, 1 / skin.size_m});
  std::vector<ProfilePoint> profile;
  for (int i = 0; i <= 40; ++i) {
    const double t = -1 + i / 20.0;
    const double body = 0.0265 * std::sqrt(std::max(0.0, 1 - std::pow(t / 0.93, 2.0)));
    const double nipple = 0.0058 * std::sqrt(std::max(0.0, 1 - std::pow(std::abs(t), 8.0)));
    profile.push_back({i == 0 || i == 40 ? 0.0 : std::max(body, nipple), 0.036 * t});
  }
  add_lathe(builder, profile, 48, 1.0);
  return finish(builder, {make_textured("skin", skin, 0.35)});
}

Model banana(Host& host, Rng rng) {
  const std::uint64_t seed = rng.bits();
  const TextureSet skin =
      make_texture_set(host, "banana_skin", 256, 0.2, false, [seed](double u, double v) {
        const double spot = fractal_noise(seed, u * 14, v * 14, 14, 14, 4);
        const double mark = std::clamp((spot - 0.42) * 8, 0.0, 0.8);
        const double tone = 1 + 0.05 * fractal_noise(seed + 1, u * 3, v * 20, 3, 20, 3);
        return Texel{blend(color(0xe8c63a) * float(tone), color(0x6b4a1e), mark), 0.0};
      });
  MeshBuilder builder;
  constexpr double kBend = 0.115;  // radius of the arc it follows
  const auto along = [&](double t) {
    const double a = std::lerp(-0.78, 0.78, t);
    return Vec3(kBend * std::sin(a), kBend * (1 - std::cos(a)), 0);
  };
  std::vector<PathPoint> body;
  for (int i = 0; i <= 40; ++i) {
    const double t = 0.08 + 0.86 * i / 40.0;
    const double r =
        0.0175 * std::pow(std::sin(kPi * std::min(0.985, 0.045 + 0.93 * (t - 0.08) / 0.86)), 0.55);
    body.push_back({along(t), r, r * 0.95});
  }
  builder.begin(Affine::Identity(), {0, 1 / skin.size_m});
  add_sweep(builder, body, 26, Vec3::UnitZ(), 2.5);
  std::vector<PathPoint> stem;
  for (int i = 0; i <= 6; ++i) {
    const double t = 0.94 + 0.10 * i / 6.0;
    stem.push_back({along(t), 0.0048 - 0.0006 * i / 6, 0.0048 - 0.0006 * i / 6});
  }
  builder.begin(Affine::Identity(), {0, 1 / skin.size_m});
  add_sweep(builder, stem, 14);
  const std::array<PathPoint, 2> tip{PathPoint{along(0.062), 0.003, 0.003},
                                     PathPoint{along(0.083), 0.005, 0.005}};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_sweep(builder, tip, 14);
  const std::array<PathPoint, 2> cut{PathPoint{along(1.038), 0.0044, 0.0044},
                                     PathPoint{along(1.05), 0.0040, 0.0040}};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_sweep(builder, cut, 14);
  return finish(builder,
                {make_textured("skin", skin, 0.5), make_plain("ends", color(0x4a3a1c), 0.8)});
}

Model ball(Host&, Rng) {
  // Pentagon patches of a truncated icosahedron on white leather.
  Canvas c(1024, 512, color(0xf1f0ea));
  const double golden = (1 + std::sqrt(5.0)) / 2;
  std::vector<Vec3> centres;
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-golden, golden}) {
      centres.push_back(Vec3(0, a, b).normalized());
      centres.push_back(Vec3(a, b, 0).normalized());
      centres.push_back(Vec3(b, 0, a).normalized());
    }
  }
  c.shade([&](double x, double y) {
    const double lon = 2 * kPi * x / 1024, lat = kPi * (0.5 - y / 512);
    const Vec3 d(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat));
    std::array<double, 2> near{-2, -2};
    for (const Vec3& p : centres) {
      const double k = d.dot(p);
      if (k > near[0]) {
        near[1] = near[0];
        near[0] = k;
      } else {
        near[1] = std::max(near[1], k);
      }
    }
    if (near[0] > 0.938) return Color(color(0x1d1f22));
    const bool is_seam = near[0] > 0.930 || near[0] - near[1] < 0.012;
    return is_seam ? Color(color(0xb9b6ac)) : Color(color(0xf1f0ea));
  });
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  std::vector<ProfilePoint> profile;
  for (int i = 0; i <= 40; ++i) {
    const double a = kPi * i / 40;
    profile.push_back({i == 0 || i == 40 ? 0.0 : 0.070 * std::sin(a), -0.070 * std::cos(a)});
  }
  add_lathe_unit_uv(builder, profile, 72, 0, 1, 3.0);
  // Heights are sines of latitudes; the picture is drawn in latitudes.
  Model model = finish(builder, {make_picture_material("leather", c.texture("ball"), 0.35)});
  Mesh mesh = *model.mesh;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const double sine = std::clamp(double(mesh.positions[i].z()) / 0.070, -1.0, 1.0);
    mesh.uvs[i].y() = float(0.5 + std::asin(sine) / kPi);
  }
  model.mesh = std::make_shared<const Mesh>(std::move(mesh));
  return model;
}

Model tennis_ball(Host& host, Rng rng) {
  const std::uint64_t seed = rng.bits();
  const TextureSet felt =
      make_texture_set(host, "felt", 256, 0.08, true, [seed](double u, double v) {
        const double fuzz = fractal_noise(seed, u * 50, v * 50, 50, 50, 3);
        return Texel{color(0xc9d63a) * float(1 + 0.18 * fuzz), 0.0007 * fuzz};
      });
  constexpr double kRadius = 0.0325;
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 1 / felt.size_m});
  std::vector<ProfilePoint> profile;
  for (int i = 0; i <= 36; ++i) {
    const double a = kPi * i / 36;
    profile.push_back({i == 0 || i == 36 ? 0.0 : kRadius * std::sin(a), -kRadius * std::cos(a)});
  }
  add_lathe(builder, profile, 56, 3.0);
  // The seam: a curve on the sphere that swings twice about the equator.
  std::vector<Vec3> seam;
  for (int i = 0; i < 120; ++i) {
    const double t = 2 * kPi * i / 119 * 0.9995;
    const double a = 0.75, b = 0.25;
    seam.push_back(Vec3(a * std::sin(t) + b * std::sin(3 * t),
                        a * std::cos(t) - b * std::cos(3 * t),
                        2 * std::sqrt(a * b) * std::cos(2 * t))
                       .normalized() *
                   (kRadius - 0.0004));
  }
  builder.begin(Affine::Identity(), {1, 1.0});
  add_tube(builder, seam, 0.0011, 8);
  return finish(builder,
                {make_textured("felt", felt, 0.95), make_plain("seam", color(0xf0efe6), 0.8)});
}

constexpr ModelKind kContainers[] = {
    {"002_master_chef_can", 0.414, coffee_can},
    {"005_tomato_soup_can", 0.349, soup_can},
    {"006_mustard_bottle", 0.603, mustard_bottle},
    {"007_tuna_fish_can", 0.171, tuna_can},
    {"010_potted_meat_can", 0.370, meat_can},
    {"011_banana", 0.066, banana},
    {"013_apple", 0.068, apple},
    {"014_lemon", 0.029, lemon},
    {"016_pear", 0.049, pear},
    {"017_orange", 0.047, orange},
    {"019_pitcher_base", 0.178, pitcher},
    {"021_bleach_cleanser", 1.131, bleach_bottle},
    {"024_bowl", 0.147, bowl},
    {"025_mug", 0.118, mug},
    {"029_plate", 0.279, plate},
    {"053_mini_soccer_ball", 0.123, ball},
    {"056_tennis_ball", 0.058, tennis_ball},
};

}  // namespace

std::span<const ModelKind> containers() { return kContainers; }

}  // namespace diorama::samples
