// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "loader_samples/model.h"
#include "modelling/noise.h"

namespace diorama::samples {

using namespace modelling;

namespace {

/// A shipping carton: fluted board, tape over the seams, marks and a label.
Model card_box(Host& host, const Vec3& size, std::uint64_t seed, const char* mark) {
  const TextureSet board = make_cardboard(host, seed, 512);
  const auto ground = [&](double x, double y) {
    const Texture& t = *board.color;
    const auto px = std::size_t(int(x) % t.width), py = std::size_t(int(y) % t.height);
    const std::size_t i = (py * std::size_t(t.width) + px) * 3;
    return Color(Color(float(t.bytes[i]), float(t.bytes[i + 1]), float(t.bytes[i + 2])) / 255.0f);
  };
  const Color tape = color(0xc2a06a), ink = color(0x4a3320);
  return make_carton(
      size, 0.002, color(0xb98e5f), 0.85,
      [&](Canvas& c, int face, double x, double y, double w, double h) {
        for (int py = int(y); py < int(y + h) && py < c.height(); ++py) {
          for (int px = int(x); px < int(x + w) && px < c.width(); ++px)
            c.at(px, py) = ground(px, py);
        }
        const double strip = 0.050 * 1024 / (2 * (size.x() + size.y()));
        if (face >= 4) {
          c.rectangle(x, y + h / 2 - 1, w, 2, color(0x6d4e2c));
          c.rectangle(x, y + h / 2 - strip / 2, w, strip, tape, 0, 0.75);
          return;
        }
        if (face < 2) c.rectangle(x + w / 2 - strip / 2, y, strip, 0.16 * h, tape, 0, 0.75);
        if (face == 2 || face == 1) {
          c.centred_text(x + w / 2, y + 0.42 * h, 0.13 * std::min(w, h), mark, ink, 0.16);
          for (int i = 0; i < 2; ++i) {  // this side up
            const double ax = x + w * (0.12 + 0.1 * i), ay = y + 0.86 * h,
                         s = 0.09 * std::min(w, h);
            c.line({ax, ay}, {ax, ay - 1.5 * s}, 0.22 * s, ink);
            c.line({ax, ay - 1.6 * s}, {ax - 0.5 * s, ay - 0.9 * s}, 0.22 * s, ink);
            c.line({ax, ay - 1.6 * s}, {ax + 0.5 * s, ay - 0.9 * s}, 0.22 * s, ink);
          }
          c.rectangle(x + 0.56 * w, y + 0.60 * h, 0.36 * w, 0.30 * h, color(0xf4f2ec));
          c.small_print(x + 0.58 * w, y + 0.62 * h, 0.32 * w, 0.12 * h, 4, color(0x333333), seed);
          c.bar_code(x + 0.60 * w, y + 0.75 * h, 0.28 * w, 0.13 * h, seed);
        }
      });
}

Model card_box_a(Host& host, Rng rng) {
  return card_box(host, {0.30, 0.22, 0.18}, rng.bits(), "FRAGILE");
}
Model card_box_d(Host& host, Rng rng) {
  return card_box(host, {0.20, 0.20, 0.22}, rng.bits(), "LOT 1847");
}

Model traffic_cone(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(at(0, 0, 0.012), {0, 1.0});
  add_box(builder, Vec3(0.26, 0.26, 0.024), 0.008, Axis::X, 3);
  const auto radius = [](double z) { return 0.098 - 0.080 * (z - 0.022) / 0.378; };
  const auto band = [&](double low, double high, std::uint16_t slot, double proud) {
    const std::array<ProfilePoint, 4> profile{
        {{0, low}, {radius(low) + proud, low}, {radius(high) + proud, high}, {0, high}}};
    builder.begin(Affine::Identity(), {slot, 1.0});
    add_lathe(builder, profile, 56, 0.5);
  };
  band(0.022, 0.400, 0, 0);
  band(0.17, 0.24, 1, 0.0008);
  band(0.29, 0.335, 1, 0.0008);
  const std::array<ProfilePoint, 4> collar{
      {{0, 0.020}, {0.108, 0.020}, {0.101, 0.034}, {0, 0.034}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, collar, 56, 0.5);
  return finish(builder, {make_plain("orange_pvc", color(0xe2531b), 0.45),
                          make_plain("reflective_white", color(0xe9eaea), 0.3)});
}

Model wet_floor_sign(Host&, Rng) {
  Canvas c(512, 1024, color(0xf3c515));
  const std::array<Vec2, 3> triangle{Vec2(256, 150), Vec2(432, 450), Vec2(80, 450)};
  c.polygon(triangle, color(0x1a1a1a));
  const std::array<Vec2, 3> inner{Vec2(256, 205), Vec2(394, 430), Vec2(118, 430)};
  c.polygon(inner, color(0xf3c515));
  c.ellipse(290, 290, 22, 22, color(0x1a1a1a));
  c.line({280, 320}, {230, 370}, 26, color(0x1a1a1a));
  c.line({230, 370}, {280, 410}, 18, color(0x1a1a1a));
  c.line({230, 370}, {180, 405}, 18, color(0x1a1a1a));
  c.line({270, 330}, {320, 360}, 14, color(0x1a1a1a));
  c.centred_text(256, 560, 66, "CAUTION", color(0xb3261e), 0.2);
  c.centred_text(256, 700, 80, "WET", color(0x1a1a1a), 0.2);
  c.centred_text(256, 820, 80, "FLOOR", color(0x1a1a1a), 0.2);
  MeshBuilder builder;
  for (const double side : {-1.0, 1.0}) {
    // Two boards leaning together at the top.
    const Affine board =
        at(0, side * 0.075, 0) * turned_z(side < 0 ? 0 : kPi) * turned_x(-0.22) * at(0, 0, 0.19);
    builder.begin(board, {0, 1.0});
    const UvRect edge{Vec2(0.01, 0.01), Vec2(0.03, 0.03)};
    add_printed_box(builder, Vec3(0.19, 0.008, 0.36), 0.0035,
                    {edge, edge, UvRect{}, edge, edge, edge}, 2);
    builder.begin(board * at(0, -0.0045, 0.0), {0, 1.0});
  }
  builder.begin(at(0, 0, 0.365), {1, 1.0});
  add_box(builder, Vec3(0.10, 0.022, 0.022), 0.006, Axis::X, 3);
  for (const double x : {-0.06, 0.06}) {
    builder.begin(at(x, 0, 0.10), {1, 1.0});
    add_box(builder, Vec3(0.006, 0.105, 0.012), 0.002, Axis::Y, 2);
  }
  return finish(builder, {make_picture_material("sign", c.texture("wet_floor"), 0.4),
                          make_plain("yellow_plastic", color(0xf0c010), 0.4)});
}

Model barrel(Host&, Rng) {
  MeshBuilder builder;
  std::vector<ProfilePoint> profile{
      {0, 0.006}, {0.130, 0.006}, {0.134, 0}, {0.143, 0}, {0.146, 0.006}};
  for (int i = 0; i <= 60; ++i) {
    const double z = 0.012 + 0.396 * i / 60.0;
    double r = 0.145;
    for (const double rib : {0.14, 0.28}) r += 0.007 * std::exp(-std::pow((z - rib) / 0.009, 2.0));
    profile.push_back({r, z});
  }
  for (const ProfilePoint& p :
       {ProfilePoint{0.146, 0.414}, ProfilePoint{0.143, 0.420}, ProfilePoint{0.134, 0.420},
        ProfilePoint{0.130, 0.412}, ProfilePoint{0, 0.412}})
    profile.push_back(p);
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, profile, 72, 0.7);
  for (const double x : {-0.07, 0.08}) {
    const std::array<ProfilePoint, 5> bung{
        {{0, 0}, {0.026, 0}, {0.026, 0.008}, {0.020, 0.011}, {0, 0.011}}};
    builder.begin(at(x, 0.02, 0.410), {1, 1.0});
    add_lathe(builder, bung, 32, 0.6);
  }
  return finish(builder, {make_plain("blue_hdpe", color(0x1f5aa6), 0.38),
                          make_plain("black_bung", color(0x202124), 0.5)});
}

Model crate(Host&, Rng) {
  MeshBuilder builder;
  const double w = 0.36, d = 0.26, h = 0.16, t = 0.006;
  const auto board = [&](const Vec3& low, const Vec3& high) {
    builder.begin(at((low + high) / 2), {0, 1.0});
    add_box(builder, high - low, 0.0018, Axis::X);
  };
  board({-w / 2, -d / 2, 0}, {w / 2, d / 2, t});
  for (int row = 0; row < 4; ++row) {
    const double z0 = t + row * (h - t) / 4, z1 = z0 + (h - t) / 4 * (row == 3 ? 1.0 : 0.72);
    board({-w / 2, -d / 2, z0}, {w / 2, -d / 2 + t, z1});
    board({-w / 2, d / 2 - t, z0}, {w / 2, d / 2, z1});
    board({-w / 2, -d / 2 + t, z0}, {-w / 2 + t, d / 2 - t, z1});
    board({w / 2 - t, -d / 2 + t, z0}, {w / 2, d / 2 - t, z1});
  }
  for (const double x : {-w / 2 + 0.012, -w / 6, w / 6, w / 2 - 0.012}) {
    for (const double y : {-d / 2 - 0.002, d / 2 + 0.002})
      board({x - 0.011, y - 0.004, 0.001}, {x + 0.011, y + 0.004, h - 0.002});
  }
  for (const double y : {-d / 4, d / 4}) {
    for (const double x : {-w / 2 - 0.002, w / 2 + 0.002})
      board({x - 0.004, y - 0.011, 0.001}, {x + 0.004, y + 0.011, h - 0.002});
  }
  builder.begin(at(0, 0, h), {0, 1.0});
  const std::array<Vec2, 4> path{Vec2(-w / 2, -d / 2), Vec2(w / 2, -d / 2), Vec2(w / 2, d / 2),
                                 Vec2(-w / 2, d / 2)};
  const std::array<Vec2, 4> section{Vec2(-0.008, -0.010), Vec2(t, -0.010), Vec2(t, 0),
                                    Vec2(-0.008, 0)};
  add_moulding(builder, section, path, true);
  return finish(builder, {make_plain("red_crate", color(0xa8261f), 0.42)});
}

Model fire_extinguisher(Host&, Rng) {
  MeshBuilder builder;
  Canvas c(512, 512, color(0xb3191b));
  c.rectangle(110, 150, 292, 260, color(0xf2efe6), 12);
  c.centred_text(256, 205, 40, "FIRE", color(0xb3191b), 0.22);
  for (int i = 0; i < 3; ++i) {
    c.rectangle(130 + 88.0 * i, 230, 74, 74, color(0xd9d4c6), 6);
    const std::array<Vec2, 3> flame{Vec2(167 + 88.0 * i, 240), Vec2(190 + 88.0 * i, 295),
                                    Vec2(144 + 88.0 * i, 295)};
    c.polygon(flame, color(0xd8641c));
  }
  c.small_print(130, 320, 250, 80, 6, color(0x333333), 3);
  const std::array<ProfilePoint, 9> tank{{{0, 0.008},
                                          {0.050, 0.008},
                                          {0.054, 0},
                                          {0.058, 0},
                                          {0.060, 0.006},
                                          {0.060, 0.300},
                                          {0.052, 0.332},
                                          {0.030, 0.350},
                                          {0, 0.352}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe_unit_uv(builder, tank, 64, 0, 1, 0.75);
  const std::array<ProfilePoint, 4> neck{{{0, 0.345}, {0.017, 0.345}, {0.017, 0.378}, {0, 0.378}}};
  builder.begin(Affine::Identity(), {2, 1.0});
  add_lathe(builder, neck, 32, 0.6);
  for (const double z : {0.372, 0.398}) {
    const std::array<Vec3, 4> lever{Vec3(0.018, 0, z), Vec3(-0.02, 0, z + 0.004),
                                    Vec3(-0.06, 0, z + (z > 0.38 ? 0.024 : -0.006)),
                                    Vec3(-0.092, 0, z + (z > 0.38 ? 0.030 : -0.014))};
    std::vector<PathPoint> path;
    for (const Vec3& p : smooth_path(lever, 5)) path.push_back({p, 0.010, 0.0028});
    builder.begin(Affine::Identity(), {1, 1.0});
    add_sweep(builder, path, 20, Vec3::UnitZ(), 4.0);
  }
  builder.begin(at(0, 0, 0.387), {1, 1.0});
  add_box(builder, Vec3(0.018, 0.014, 0.030), 0.003, Axis::Z, 2);
  const std::array<Vec3, 7> hose{Vec3(0.012, 0, 0.365), Vec3(0.05, 0, 0.366), Vec3(0.078, 0, 0.34),
                                 Vec3(0.082, 0, 0.27),  Vec3(0.078, 0, 0.19), Vec3(0.073, 0, 0.13),
                                 Vec3(0.071, 0, 0.11)};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_tube(builder, smooth_path(hose, 6), 0.0075, 16);
  const std::array<ProfilePoint, 5> nozzle{
      {{0, 0.045}, {0.013, 0.045}, {0.0125, 0.050}, {0.0085, 0.115}, {0, 0.115}}};
  builder.begin(at(0.0725, 0, 0), {1, 1.0});
  add_lathe(builder, nozzle, 24, 0.6);
  const std::array<ProfilePoint, 4> gauge{{{0, 0}, {0.014, 0}, {0.014, 0.010}, {0, 0.011}}};
  builder.begin(at(0, -0.014, 0.362) * turned_x(kPi / 2), {2, 1.0});
  add_lathe(builder, gauge, 28, 0.6);
  return finish(builder, {make_picture_material("tank", c.texture("extinguisher"), 0.25),
                          make_plain("black", color(0x1c1d1f), 0.45),
                          make_plain("brass", color(0xcaa45c), 0.3, 1.0)});
}

Model desk_lamp(Host&, Rng) {
  MeshBuilder builder;
  const std::array<ProfilePoint, 5> foot{
      {{0, 0}, {0.080, 0}, {0.082, 0.006}, {0.070, 0.018}, {0, 0.020}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, foot, 56, 0.7);
  const Vec3 base(0, 0, 0.018), elbow(-0.10, 0, 0.20), head(0.07, 0, 0.345);
  for (const double y : {-0.006, 0.006}) {
    for (const auto& [a, b] : {std::pair{base, elbow}, std::pair{elbow, head}}) {
      const std::array<Vec3, 2> rod{Vec3(a + Vec3(0, y, 0)), Vec3(b + Vec3(0, y, 0))};
      builder.begin(Affine::Identity(), {1, 1.0});
      add_tube(builder, rod, 0.004, 14);
    }
  }
  for (const Vec3& joint : {elbow, head}) {
    const std::array<ProfilePoint, 5> hinge{
        {{0, -0.013}, {0.012, -0.013}, {0.0135, 0}, {0.012, 0.013}, {0, 0.013}}};
    builder.begin(at(joint) * turned_x(kPi / 2), {0, 1.0});
    add_lathe(builder, hinge, 28, 0.7);
  }
  const std::array<ProfilePoint, 6> shade{
      {{0.066, -0.085}, {0.030, -0.010}, {0.018, 0.012}, {0.0, 0.016}, {0.0, 0.013}, {0.0, 0.013}}};
  std::vector<ProfilePoint> ring(shade.begin(), shade.begin() + 4);
  ring.push_back({0.0, 0.0130});
  ring.push_back({0.016, 0.009});
  ring.push_back({0.0275, -0.0115});
  ring.push_back({0.0640, -0.085});
  ring.push_back(ring.front());
  // The profile touches the axis in the middle, so it is turned as two walls that meet there.
  builder.begin(at(head + Vec3(0.012, 0, 0)) * turned_y(-0.35), {0, 1.0});
  add_lathe(builder, ring, 56, 0.7);
  const std::array<ProfilePoint, 6> bulb{
      {{0, -0.060}, {0.012, -0.056}, {0.019, -0.040}, {0.014, -0.020}, {0.011, 0.0}, {0, 0.002}}};
  builder.begin(at(head + Vec3(0.012, 0, 0)) * turned_y(-0.35), {2, 1.0});
  add_lathe(builder, bulb, 32, 0.9);
  return finish(builder, {make_plain("green_enamel", color(0x2f5f4f), 0.3),
                          make_plain("steel", color(0xbfc1c4), 0.25, 1.0),
                          make_plain("white_bulb", color(0xf2efe6), 0.3)});
}

Model vase(Host&, Rng) {
  MeshBuilder builder;
  const std::array<ProfilePoint, 7> outer{{{0.038, 0},
                                           {0.044, 0.006},
                                           {0.075, 0.09},
                                           {0.070, 0.15},
                                           {0.034, 0.215},
                                           {0.030, 0.235},
                                           {0.042, 0.26}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, vessel(smooth_profile(outer, 8), 0.004), 72, 0.8);
  for (const double z : {0.06, 0.125}) {
    const double r = z < 0.1 ? 0.0655 : 0.0766;
    std::vector<Vec3> ring;
    for (int i = 0; i <= 72; ++i)
      ring.emplace_back(r * std::cos(2 * kPi * i / 72 * 0.9997),
                        r * std::sin(2 * kPi * i / 72 * 0.9997), z);
    builder.begin(Affine::Identity(), {1, 1.0});
    add_tube(builder, ring, 0.0022, 8);
  }
  return finish(builder, {make_plain("celadon", color(0x7fa38f), 0.15),
                          make_plain("gilt", color(0xd2ab58), 0.25, 1.0)});
}

Model tablet(Host&, Rng) {
  Canvas c(768, 1024, color(0x0d1016));
  c.rectangle(28, 28, 712, 968, color(0x1d3557));
  c.rectangle(28, 28, 712, 60, color(0x14263f));
  for (int i = 0; i < 12; ++i) {
    const double x = 80 + 166.0 * (i % 4), y = 150 + 190.0 * (i / 4);
    const std::array<std::uint32_t, 5> icons{0xe76f51, 0x2a9d8f, 0xe9c46a, 0xf4f1de, 0x8ab17d};
    c.rectangle(x, y, 110, 110, color(icons[std::size_t(i) % icons.size()]), 24);
    c.small_print(x + 15, y + 122, 80, 18, 1, color(0xf4f1de), std::uint64_t(i));
  }
  c.rectangle(90, 800, 588, 130, color(0x2c4a70), 30);
  MeshBuilder builder;
  builder.begin(at(0, 0, 0.0036), {0, 1.0});
  add_prism(builder, rounded_rectangle(0.175, 0.240, 0.012, 10), 0.0042, 0.0010);
  builder.begin(Affine::Identity(), {0, 1.0});
  add_prism(builder, rounded_rectangle(0.175, 0.240, 0.012, 10), 0.0040, 0.0018);
  builder.begin(at(0, 0, 0.0079), {1, 1.0});
  const UvRect dark{Vec2(0.005, 0.005), Vec2(0.01, 0.01)};
  add_printed_box(builder, Vec3(0.165, 0.228, 0.0006), 0.0002,
                  {dark, dark, dark, dark, dark, UvRect{}});
  return finish(builder, {make_plain("aluminium", color(0xa9acb0), 0.35, 1.0),
                          make_picture_material("screen", c.texture("screen"), 0.08)});
}

Model book_stack(Host&, Rng rng) {
  constexpr int kBooks = 4;
  const MaterialPtr covers =
      make_picture_material("covers", make_book_spines(rng.fork("spines"), kBooks, 512, 512), 0.6);
  MeshBuilder builder;
  double z = 0;
  for (int i = 0; i < kBooks; ++i) {
    const double thick = rng.uniform(0.02, 0.038), length = rng.uniform(0.20, 0.25),
                 depth = rng.uniform(0.14, 0.18);
    const Affine pose = at(rng.uniform(-0.008, 0.008), rng.uniform(-0.008, 0.008), z) *
                        turned_z(rng.uniform(-0.2, 0.2));
    const double u = double(i) / kBooks, du = 1.0 / kBooks;
    const UvRect plain{Vec2(u + 0.3 * du, 0.20), Vec2(u + 0.7 * du, 0.26)};
    constexpr double kCover = 0.0025;
    const auto board = [&](const Vec3& low, const Vec3& high) {
      builder.begin(pose * at((low + high) / 2), {0, 1.0});
      add_printed_box(builder, high - low, 0.0008, {plain, plain, plain, plain, plain, plain});
    };
    board({-length / 2, -depth / 2, 0}, {length / 2, depth / 2, kCover});
    board({-length / 2, -depth / 2, thick - kCover}, {length / 2, depth / 2, thick});
    // The spine: turned so that the picture's column runs along it.
    builder.begin(pose * at(0, -depth / 2 + kCover / 2, thick / 2) * turned_y(kPi / 2), {0, 1.0});
    add_printed_box(builder, Vec3(thick - 2 * kCover, kCover, length), 0.0008,
                    {plain, plain, UvRect{Vec2(u + 0.01 * du, 0), Vec2(u + 0.99 * du, 1)}, plain,
                     plain, plain});
    builder.begin(pose * at(0, 0.0005, thick / 2), {1, 1.0});
    add_box(builder, Vec3(length - 0.008, depth - 0.007, thick - 2 * kCover), 0.0005, Axis::X);
    z += thick;
  }
  return finish(builder, {covers, make_plain("paper", color(0xece4d2), 0.9)});
}

Model pen_holder(Host&, Rng rng) {
  MeshBuilder builder;
  const std::array<ProfilePoint, 3> outer{{{0.038, 0}, {0.040, 0.004}, {0.040, 0.098}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, vessel(outer, 0.002), 56, 0.8);
  for (int i = 0; i < 6; ++i) {
    const double a = 2 * kPi * i / 6 + rng.uniform(-0.2, 0.2), lean = rng.uniform(0.10, 0.17);
    const Vec3 out(std::cos(a), std::sin(a), 0);
    const Affine pose = at(out * 0.014 + Vec3(0, 0, 0.006)) *
                        Affine(Eigen::AngleAxisd(lean, Vec3(-out.y(), out.x(), 0)));
    const double length = rng.uniform(0.13, 0.155);
    const std::array<ProfilePoint, 4> rod{
        {{0, 0}, {0.0036, 0.001}, {0.0036, length - 0.02}, {0, length - 0.02}}};
    builder.begin(pose, {std::uint16_t(1 + i % 4), 1.0});
    add_lathe(builder, rod, 12, 0.6);
    const std::array<ProfilePoint, 4> tip{
        {{0, length - 0.0201}, {0.0036, length - 0.0201}, {0.0007, length}, {0, length}}};
    builder.begin(pose, {5, 1.0});
    add_lathe(builder, tip, 12, 0.5);
  }
  return finish(
      builder,
      {make_plain("mesh_black", color(0x2a2b2e), 0.4, 0.6),
       make_plain("pen_red", color(0xb5302a), 0.35), make_plain("pen_blue", color(0x27519e), 0.35),
       make_plain("pencil", color(0xe0ae2e), 0.5), make_plain("pen_green", color(0x2e7d4a), 0.35),
       make_plain("tip", color(0xd8bd92), 0.7)});
}

Model stapler(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(at(0, 0, 0.005), {0, 1.0});
  add_box(builder, Vec3(0.145, 0.034, 0.010), 0.004, Axis::X, 3);
  const std::array<PathPoint, 7> top{PathPoint{Vec3(-0.068, 0, 0.024), 0.011, 0.008},
                                     PathPoint{Vec3(-0.062, 0, 0.028), 0.0165, 0.013},
                                     PathPoint{Vec3(-0.03, 0, 0.036), 0.0175, 0.0145},
                                     PathPoint{Vec3(0.02, 0, 0.043), 0.0172, 0.0135},
                                     PathPoint{Vec3(0.058, 0, 0.046), 0.0165, 0.0110},
                                     PathPoint{Vec3(0.070, 0, 0.045), 0.0155, 0.0085},
                                     PathPoint{Vec3(0.074, 0, 0.044), 0.012, 0.005}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_sweep(builder, top, 32, Vec3::UnitZ(), 3.2);
  builder.begin(at(0.004, 0, 0.028) * turned_y(-0.06), {1, 1.0});
  add_box(builder, Vec3(0.130, 0.016, 0.010), 0.001, Axis::X);
  builder.begin(at(-0.056, 0, 0.018), {1, 1.0});
  add_box(builder, Vec3(0.022, 0.026, 0.022), 0.003, Axis::X, 2);
  builder.begin(at(0.058, 0, 0.0105), {1, 1.0});
  add_box(builder, Vec3(0.018, 0.022, 0.003), 0.001, Axis::X);
  return finish(builder, {make_plain("stapler_blue", color(0x28447a), 0.32),
                          make_plain("steel", color(0xbabdc0), 0.3, 1.0)});
}

Model coffee_cup(Host&, Rng) {
  MeshBuilder builder;
  Canvas c(512, 256, color(0xf3f0e9));
  c.rectangle(0, 90, 512, 110, color(0x7a4b2c));
  for (const double x : {128.0, 384.0}) {
    c.ellipse(x, 145, 46, 40, color(0xf3f0e9));
    c.centred_text(x, 157, 24, "MORO", color(0x7a4b2c), 0.2);
  }
  const std::array<ProfilePoint, 5> wall{
      {{0, 0.004}, {0.0285, 0.004}, {0.0285, 0}, {0.0300, 0}, {0.0400, 0.104}}};
  std::vector<ProfilePoint> profile(wall.begin(), wall.end());
  profile.push_back({0, 0.104});
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe_unit_uv(builder, profile, 64, 0, 1, 0.5);
  const std::array<ProfilePoint, 9> lid{{{0, 0.102},
                                         {0.0415, 0.102},
                                         {0.0430, 0.104},
                                         {0.0425, 0.110},
                                         {0.0395, 0.112},
                                         {0.0380, 0.118},
                                         {0.0360, 0.118},
                                         {0.0340, 0.114},
                                         {0, 0.114}}};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_lathe(builder, lid, 64, 0.6);
  return finish(builder, {make_picture_material("paper_cup", c.texture("cup"), 0.55),
                          make_plain("lid_black", color(0x1f1f21), 0.4)});
}

Model globe(Host&, Rng rng) {
  const std::uint64_t seed = rng.bits();
  Canvas c(1024, 512, color(0x3f7fae));
  c.shade([&](double x, double y) {
    const double u = x / 1024, v = y / 512;
    const double polar = std::sin(kPi * v);
    const double land = fractal_noise(seed, u * 5, v * 3, 5, 64, 6, 0.55) + 0.10 * polar;
    Color col = blend(color(0x2f6f9f), color(0x6fb0cf), std::clamp((land + 0.35) * 2, 0.0, 1.0));
    if (land > 0.08)
      col = blend(color(0x7fa05a), color(0xd9c387),
                  std::clamp((land - 0.08) * 4 + 0.4 * std::abs(polar - 0.75), 0.0, 1.0));
    if (std::abs(v - 0.5) > 0.42)
      col = blend(col, color(0xf2f5f6), std::clamp((std::abs(v - 0.5) - 0.42) * 30, 0.0, 1.0));
    const bool is_grid = std::abs(u * 24 - std::round(u * 24)) < 0.02 ||
                         std::abs(v * 12 - std::round(v * 12)) < 0.018;
    return is_grid ? blend(col, color(0xf4efe0), 0.45) : col;
  });
  MeshBuilder builder;
  std::vector<ProfilePoint> profile;
  for (int i = 0; i <= 48; ++i) {
    const double a = kPi * i / 48;
    profile.push_back({i == 0 || i == 48 ? 0.0 : 0.085 * std::sin(a), -0.085 * std::cos(a)});
  }
  const Affine tilt = at(0, 0, 0.150) * turned_x(0.41);
  builder.begin(tilt, {0, 1.0});
  add_lathe_unit_uv(builder, profile, 72, 0, 1, 3.0);
  const std::array<ProfilePoint, 6> foot{
      {{0, 0}, {0.062, 0}, {0.064, 0.006}, {0.030, 0.016}, {0.010, 0.026}, {0, 0.027}}};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_lathe(builder, foot, 56, 0.7);
  std::vector<PathPoint> arc;
  for (int i = 0; i <= 36; ++i) {
    const double a = -kPi / 2 + kPi * i / 36.0;
    const Vec3 p = tilt * Vec3(0, 0.096 * std::cos(a), 0.096 * std::sin(a));
    arc.push_back({p, 0.0065, 0.0022});
  }
  builder.begin(Affine::Identity(), {1, 1.0});
  add_sweep(builder, arc, 16, Vec3::UnitX(), 3.0);
  for (const double side : {-1.0, 1.0}) {
    const std::array<ProfilePoint, 4> pin{{{0, 0.080}, {0.003, 0.080}, {0.003, 0.102}, {0, 0.103}}};
    builder.begin(tilt * (side > 0 ? Affine::Identity() : turned_x(kPi)), {1, 1.0});
    add_lathe(builder, pin, 16, 0.6);
  }
  const std::array<Vec3, 2> stem{Vec3(0, 0.0, 0.022), Vec3(tilt * Vec3(0, 0.038, -0.088))};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_tube(builder, stem, 0.0052, 16);
  Model model = finish(builder, {make_picture_material("map", c.texture("globe"), 0.35),
                                 make_plain("brass", color(0xc9a154), 0.28, 1.0)});
  return model;
}

Model potted_plant(Host&, Rng rng) {
  MeshBuilder builder;
  const std::array<ProfilePoint, 4> outer{
      {{0.042, 0}, {0.046, 0.006}, {0.058, 0.085}, {0.060, 0.095}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, vessel(smooth_profile(outer, 5), 0.004), 56, 0.8);
  const std::array<ProfilePoint, 4> soil{{{0, 0.075}, {0.0515, 0.075}, {0.050, 0.083}, {0, 0.088}}};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_lathe(builder, soil, 40, 0.4);
  for (int i = 0; i < 22; ++i) {
    const double a = 2.39996 * i, ring = 0.2 + 0.8 * i / 22.0;
    const double length = 0.07 + 0.05 * ring + rng.uniform(0, 0.01), width = 0.020;
    const Vec3 out(std::cos(a), std::sin(a), 0), side(-std::sin(a), std::cos(a), 0);
    const double rise = std::lerp(1.25, 0.55, ring);
    const auto surface = [&](double u, double v) {
      const double shape = std::pow(std::sin(kPi * std::min(1.0, 0.12 + 0.86 * v)), 0.6);
      const double x = (2 * u - 1) * width / 2 * shape;
      return Vec3(out * (0.006 + length * v * (0.35 + 0.5 * ring)) +
                  Vec3(0, 0, 0.082 + length * (rise * v - 0.25 * ring * v * v)) + side * x +
                  Vec3(0, 0, 9.0 * x * x));
    };
    builder.begin(Affine::Identity(), {2, 1.0});
    add_sheet(builder, 6, 10, 0.0028, surface, Vec2(width, length));
  }
  return finish(builder, {make_plain("terracotta", color(0xb3653f), 0.7),
                          make_plain("soil", color(0x38291e), 1.0),
                          make_plain("succulent", color(0x5f8f5a), 0.45)});
}

Model medical_bag(Host& host, Rng rng) {
  const TextureSet cloth =
      make_fabric(host, color(0xa5201f), color(0x951b1b), 0.7, rng.bits(), 256);
  MeshBuilder builder;
  builder.begin(at(0, 0, 0.095), {0, 1 / cloth.size_m});
  add_box(builder, Vec3(0.29, 0.15, 0.19), 0.032, Axis::X, 5);
  builder.begin(at(0, -0.078, 0.075), {0, 1 / cloth.size_m});
  add_box(builder, Vec3(0.19, 0.024, 0.105), 0.010, Axis::X, 4);
  // Cross on a round badge.
  const std::array<ProfilePoint, 5> badge{
      {{0, 0}, {0.033, 0}, {0.033, 0.0016}, {0.031, 0.0026}, {0, 0.0026}}};
  builder.begin(at(0, -0.0895, 0.080) * turned_x(kPi / 2), {1, 1.0});
  add_lathe(builder, badge, 48, 0.6);
  for (const auto& size : {Vec3(0.044, 0.002, 0.014), Vec3(0.014, 0.0022, 0.044)}) {
    builder.begin(at(0, -0.0928, 0.080), {2, 1.0});
    add_box(builder, size, 0.0006, Axis::X);
  }
  // Zip and straps.
  for (const double y : {-0.0765, 0.0765}) {
    builder.begin(at(0, y * 0.98, 0.150), {3, 1.0});
    add_box(builder, Vec3(0.22, 0.006, 0.008), 0.002, Axis::X, 2);
  }
  for (const double y : {-0.045, 0.045}) {
    std::vector<PathPoint> strap;
    const std::array<Vec3, 7> knots{Vec3(-0.085, y, 0.170),       Vec3(-0.080, y, 0.205),
                                    Vec3(-0.055, y * 0.6, 0.240), Vec3(0, y * 0.35, 0.256),
                                    Vec3(0.055, y * 0.6, 0.240),  Vec3(0.080, y, 0.205),
                                    Vec3(0.085, y, 0.170)};
    for (const Vec3& p : smooth_path(knots, 6)) strap.push_back({p, 0.011, 0.0024});
    builder.begin(Affine::Identity(), {3, 1.0});
    add_sweep(builder, strap, 18, Vec3::UnitZ(), 4.0);
  }
  return finish(
      builder,
      {make_textured("nylon", cloth, 0.8), make_plain("badge", color(0xf3f2ee), 0.5),
       make_plain("cross", color(0xb01c1c), 0.5), make_plain("strap", color(0x202124), 0.7)});
}

Model medical_box(Host&, Rng) {
  MeshBuilder builder;
  builder.begin(at(0, 0, 0.048), {0, 1.0});
  add_box(builder, Vec3(0.27, 0.19, 0.096), 0.010, Axis::X, 4);
  builder.begin(at(0, 0, 0.1165), {0, 1.0});
  add_box(builder, Vec3(0.274, 0.194, 0.040), 0.010, Axis::X, 4);
  for (const double x : {-0.075, 0.075}) {
    builder.begin(at(x, -0.098, 0.096), {2, 1.0});
    add_box(builder, Vec3(0.030, 0.007, 0.034), 0.002, Axis::Z, 2);
  }
  std::vector<PathPoint> handle;
  const std::array<Vec3, 5> knots{Vec3(-0.055, 0, 0.134), Vec3(-0.050, 0, 0.154), Vec3(0, 0, 0.164),
                                  Vec3(0.050, 0, 0.154), Vec3(0.055, 0, 0.134)};
  for (const Vec3& p : smooth_path(knots, 6)) handle.push_back({p, 0.010, 0.006});
  builder.begin(Affine::Identity(), {2, 1.0});
  add_sweep(builder, handle, 18, Vec3::UnitZ(), 3.0);
  for (const auto& size : {Vec3(0.058, 0.002, 0.018), Vec3(0.018, 0.0024, 0.058)}) {
    builder.begin(at(0, -0.0955, 0.048), {1, 1.0});
    add_box(builder, size, 0.0007, Axis::X);
  }
  return finish(builder, {make_plain("white_case", color(0xeeeeea), 0.38),
                          make_plain("green_cross", color(0x1d8a4e), 0.45),
                          make_plain("grey_latch", color(0x55585c), 0.45)});
}

Model pill_bottle(Host&, Rng) {
  Canvas c(512, 256, color(0xf5f4f0));
  c.rectangle(0, 0, 512, 60, color(0x2a7ab0));
  c.centred_text(256, 46, 32, "VITALUX", color(0xffffff), 0.2);
  c.small_print(150, 80, 212, 120, 8, color(0x2c2c2c), 4);
  c.bar_code(390, 100, 90, 90, 2);
  MeshBuilder builder;
  const std::array<ProfilePoint, 7> body{{{0, 0},
                                          {0.0215, 0},
                                          {0.0235, 0.003},
                                          {0.0235, 0.066},
                                          {0.0205, 0.072},
                                          {0.018, 0.074},
                                          {0, 0.074}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, body, 56, 0.6);
  const std::array<ProfilePoint, 4> label{
      {{0, 0.012}, {0.02385, 0.012}, {0.02385, 0.060}, {0, 0.060}}};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_lathe_unit_uv(builder, label, 56, 0, 1, 0.5);
  const std::array<ProfilePoint, 5> cap{
      {{0, 0.0735}, {0.0225, 0.0735}, {0.0225, 0.092}, {0.0210, 0.094}, {0, 0.094}}};
  builder.begin(Affine::Identity(), {2, 1.0});
  add_lathe(builder, cap, 56, 0.6);
  for (int i = 0; i < 30; ++i) {
    const double a = 2 * kPi * i / 30;
    builder.begin(at(0.0225 * std::cos(a), 0.0225 * std::sin(a), 0.083) * turned_z(a), {2, 1.0});
    add_box(builder, Vec3(0.0014, 0.0016, 0.016), 0.0005, Axis::Z);
  }
  return finish(builder, {make_plain("amber", color(0xc06a1e), 0.15),
                          make_picture_material("label", c.texture("pills"), 0.5),
                          make_plain("white_cap", color(0xf1f0ec), 0.4)});
}

Model clipboard(Host& host, Rng rng) {
  const TextureSet board =
      make_wood(host, {color(0x9a7248), color(0x7f5a36), 0.3}, rng.bits(), 256);
  Canvas c(512, 724, color(0xf8f7f2));
  c.centred_text(256, 70, 34, "CHART", color(0x22324a), 0.18);
  for (int i = 0; i < 5; ++i) {
    c.rectangle(50, 110 + 112.0 * i, 412, 2, color(0x8a94a3));
    c.small_print(56, 120 + 112.0 * i, 380, 84, 4, color(0x30353c), 10 + std::uint64_t(i));
  }
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 1 / board.size_m});
  add_prism(builder, rounded_rectangle(0.225, 0.315, 0.012, 8), 0.004, 0.001);
  builder.begin(at(0, -0.006, 0.0049), {1, 1.0});
  const UvRect plain{Vec2(0.02, 0.02), Vec2(0.04, 0.04)};
  add_printed_box(builder, Vec3(0.206, 0.290, 0.002), 0.0006,
                  {plain, plain, plain, plain, plain, UvRect{}});
  builder.begin(at(0, 0.138, 0.0075), {2, 1.0});
  add_box(builder, Vec3(0.105, 0.030, 0.0060), 0.0022, Axis::X, 3);
  const std::array<Vec3, 2> roll{Vec3(-0.050, 0.146, 0.0125), Vec3(0.050, 0.146, 0.0125)};
  builder.begin(Affine::Identity(), {2, 1.0});
  add_tube(builder, roll, 0.0052, 18);
  return finish(builder, {make_textured("hardboard", board, 0.6),
                          make_picture_material("sheet", c.texture("chart"), 0.85),
                          make_plain("clip_steel", color(0xc3c6c9), 0.25, 1.0)});
}

Model green_barrel(Host&, Rng) {
  MeshBuilder builder;
  std::vector<ProfilePoint> profile{{0, 0}, {0.118, 0}, {0.126, 0.008}};
  for (int i = 0; i <= 40; ++i) {
    const double t = i / 40.0;
    profile.push_back({0.126 + 0.022 * std::sin(kPi * t), 0.010 + 0.340 * t});
  }
  for (const ProfilePoint& p : {ProfilePoint{0.118, 0.360}, ProfilePoint{0, 0.360}}) {
    profile.push_back(p);
  }
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, profile, 64, 0.7);
  const std::array<ProfilePoint, 6> lid{
      {{0, 0.355}, {0.129, 0.355}, {0.132, 0.362}, {0.128, 0.382}, {0.112, 0.388}, {0, 0.388}}};
  builder.begin(Affine::Identity(), {1, 1.0});
  add_lathe(builder, lid, 64, 0.6);
  for (const double side : {-1.0, 1.0}) {
    builder.begin(at(side * 0.150, 0, 0.250), {1, 1.0});
    add_box(builder, Vec3(0.020, 0.090, 0.028), 0.006, Axis::Y, 3);
  }
  return finish(builder, {make_plain("green_hdpe", color(0x2f6b43), 0.42),
                          make_plain("black_lid", color(0x232427), 0.5)});
}

Model white_board(Host&, Rng) {
  Canvas c(1024, 640, color(0xf6f7f7));
  c.centred_text(360, 90, 60, "PLAN", color(0x22478f), 0.12);
  c.line({120, 180}, {420, 360}, 6, color(0xb02a2a));
  c.line({420, 360}, {620, 250}, 6, color(0xb02a2a));
  c.line({620, 250}, {900, 480}, 6, color(0xb02a2a));
  c.rectangle(700, 110, 200, 120, color(0xbfd9ea), 8);
  c.small_print(120, 420, 360, 150, 5, color(0x2a2f36), 12);
  MeshBuilder builder;
  const UvRect plain{Vec2(0.01, 0.01), Vec2(0.02, 0.02)};
  builder.begin(at(0, 0, 0.15), {0, 1.0});
  add_printed_box(builder, Vec3(0.44, 0.010, 0.275), 0.001,
                  {plain, plain, UvRect{}, plain, plain, plain});
  for (const double z : {0.0055, 0.2945}) {
    builder.begin(at(0, 0, z), {1, 1.0});
    add_box(builder, Vec3(0.47, 0.018, 0.014), 0.003, Axis::X, 2);
  }
  for (const double x : {-0.2275, 0.2275}) {
    builder.begin(at(x, 0, 0.15), {1, 1.0});
    add_box(builder, Vec3(0.015, 0.0178, 0.275), 0.003, Axis::Z, 2);
  }
  builder.begin(at(0.02, -0.022, 0.004), {1, 1.0});
  add_box(builder, Vec3(0.28, 0.036, 0.006), 0.002, Axis::X, 2);
  return finish(builder, {make_picture_material("writing", c.texture("white_board"), 0.2),
                          make_plain("aluminium_rail", color(0xb4b7ba), 0.35, 1.0)});
}

/// A bound book that lies on its back.
Model bound_book(const char* title, const Vec3& size, std::uint32_t cloth, std::uint32_t ink,
                 std::uint64_t seed) {
  Canvas c(512, 720, color(cloth));
  c.rectangle(34, 34, 444, 652, color(ink), 6);
  c.rectangle(42, 42, 428, 636, color(cloth), 5);
  c.centred_text(256, 210, 64, title, color(ink), 0.16);
  c.ellipse(256, 400, 90, 90, color(ink));
  c.ellipse(256, 400, 72, 72, color(cloth));
  c.small_print(130, 560, 252, 60, 3, color(ink), seed);
  constexpr double kCover = 0.003;
  const UvRect plain{Vec2(0.01, 0.01), Vec2(0.03, 0.03)};
  MeshBuilder builder;
  builder.begin(at(0, 0, kCover / 2), {0, 1.0});
  add_printed_box(builder, Vec3(size.x(), size.y(), kCover), 0.0008,
                  {plain, plain, plain, plain, plain, plain});
  builder.begin(at(0, 0, size.z() - kCover / 2), {0, 1.0});
  add_printed_box(builder, Vec3(size.x(), size.y(), kCover), 0.0008,
                  {plain, plain, plain, plain, plain, UvRect{}});
  builder.begin(at(-size.x() / 2 + kCover / 2, 0, size.z() / 2), {0, 1.0});
  add_printed_box(builder, Vec3(kCover, size.y(), size.z() - 2 * kCover), 0.0008,
                  {plain, plain, plain, plain, plain, plain});
  builder.begin(at(0.0005, 0, size.z() / 2), {1, 1.0});
  add_box(builder, Vec3(size.x() - 0.009, size.y() - 0.008, size.z() - 2 * kCover), 0.0006,
          Axis::Y);
  return finish(builder, {make_picture_material("binding", c.texture("book"), 0.6),
                          make_plain("book_paper", color(0xeae1cd), 0.9)});
}

Model book_red(Host&, Rng) {
  return bound_book("ATLAS", {0.172, 0.240, 0.034}, 0x8a2a2c, 0xd9bd73, 31);
}

Model book_blue(Host&, Rng) {
  return bound_book("TIDES", {0.135, 0.205, 0.026}, 0x24496e, 0xe6e2d4, 47);
}

Model open_book(Host&, Rng) {
  Canvas c(1024, 720, color(0xf4efe1));
  for (const double x : {60.0, 560.0}) {
    c.centred_text(x + 200, 70, 30, x < 500 ? "XII" : "XIII", color(0x33302a), 0.16);
    c.small_print(x, 110, 400, x < 500 ? 540 : 250, x < 500 ? 20 : 9, color(0x3a3731),
                  std::uint64_t(x));
  }
  c.rectangle(590, 400, 340, 240, color(0x9db4a4), 4);
  c.ellipse(760, 510, 80, 60, color(0xe4d9b8));
  const UvRect plain{Vec2(0.005, 0.005), Vec2(0.01, 0.01)};
  MeshBuilder builder;
  for (const double side : {-1.0, 1.0}) {
    const Affine half = at(side * 0.088, 0, 0.014) * turned_y(side * 0.06);
    const UvRect page =
        side < 0 ? UvRect{Vec2(0, 0), Vec2(0.5, 1)} : UvRect{Vec2(0.5, 0), Vec2(1, 1)};
    builder.begin(half, {0, 1.0});
    add_printed_box(builder, Vec3(0.168, 0.238, 0.016), 0.003,
                    {plain, plain, plain, plain, plain, page}, 2);
    builder.begin(half * at(0, 0, -0.0100), {1, 1.0});
    add_box(builder, Vec3(0.178, 0.250, 0.004), 0.001, Axis::Y);
  }
  builder.begin(at(0, 0, 0.010), {1, 1.0});
  add_box(builder, Vec3(0.020, 0.250, 0.006), 0.002, Axis::Y, 2);
  return finish(builder, {make_picture_material("pages", c.texture("open_book"), 0.85),
                          make_plain("green_cloth", color(0x2f4a3a), 0.7)});
}

Model briefcase(Host& host, Rng rng) {
  const TextureSet leather = make_leather(host, color(0x5a3722), rng.bits(), 256);
  MeshBuilder builder;
  builder.begin(at(0, 0, 0.155), {0, 1 / leather.size_m});
  add_box(builder, Vec3(0.42, 0.105, 0.30), 0.016, Axis::X, 4);
  builder.begin(at(0, 0, 0.245), {1, 1.0});
  add_box(builder, Vec3(0.4225, 0.1075, 0.006), 0.002, Axis::X);
  for (const double x : {-0.12, 0.12}) {
    builder.begin(at(x, -0.0550, 0.240), {2, 1.0});
    add_box(builder, Vec3(0.044, 0.008, 0.034), 0.002, Axis::X, 2);
    builder.begin(at(x * 0.6, 0, 0.310), {2, 1.0});
    add_box(builder, Vec3(0.022, 0.018, 0.018), 0.003, Axis::X, 2);
  }
  std::vector<PathPoint> handle;
  const std::array<Vec3, 5> knots{Vec3(-0.072, 0, 0.312), Vec3(-0.064, 0, 0.342), Vec3(0, 0, 0.352),
                                  Vec3(0.064, 0, 0.342), Vec3(0.072, 0, 0.312)};
  for (const Vec3& p : smooth_path(knots, 6)) handle.push_back({p, 0.011, 0.007});
  builder.begin(Affine::Identity(), {1, 1.0});
  add_sweep(builder, handle, 18, Vec3::UnitY(), 3.0);
  return finish(builder, {make_textured("brown_leather", leather, 0.5),
                          make_plain("dark_seam", color(0x2c1b12), 0.5),
                          make_plain("brass_lock", color(0xc29a4e), 0.3, 1.0)});
}

Model gas_cart(Host&, Rng) {
  MeshBuilder builder;
  for (const double x : {-0.062, 0.062}) {
    const std::array<ProfilePoint, 8> cylinder{{{0, 0.030},
                                                {0.050, 0.030},
                                                {0.054, 0.036},
                                                {0.054, 0.290},
                                                {0.044, 0.325},
                                                {0.020, 0.340},
                                                {0.014, 0.362},
                                                {0, 0.362}}};
    builder.begin(at(x, 0, 0), {std::uint16_t(x < 0 ? 0 : 1), 1.0});
    add_lathe(builder, cylinder, 48, 0.6);
    const std::array<ProfilePoint, 4> valve{{{0, 0}, {0.016, 0}, {0.016, 0.016}, {0, 0.016}}};
    builder.begin(at(x, 0, 0.360), {2, 1.0});
    add_lathe(builder, valve, 24, 0.5);
    const std::array<ProfilePoint, 6> wheel{{{0, -0.012},
                                             {0.036, -0.012},
                                             {0.042, -0.006},
                                             {0.042, 0.006},
                                             {0.036, 0.012},
                                             {0, 0.012}}};
    builder.begin(at(x < 0 ? -0.130 : 0.130, 0.055, 0.042) * turned_y(kPi / 2), {3, 1.0});
    add_lathe(builder, wheel, 36, 0.6);
    const std::array<Vec3, 2> post{Vec3(x < 0 ? -0.112 : 0.112, 0.060, 0.030),
                                   Vec3(x < 0 ? -0.112 : 0.112, 0.060, 0.450)};
    builder.begin(Affine::Identity(), {2, 1.0});
    add_tube(builder, post, 0.0085, 16);
  }
  builder.begin(at(0, 0, 0.024), {2, 1.0});
  add_box(builder, Vec3(0.250, 0.130, 0.010), 0.003, Axis::X, 2);
  for (const double z : {0.180, 0.446}) {
    builder.begin(at(0, 0.062, z), {2, 1.0});
    add_box(builder, Vec3(0.232, 0.010, 0.018), 0.003, Axis::X, 2);
  }
  return finish(builder, {make_plain("oxygen_white", color(0xe8e9e6), 0.35),
                          make_plain("air_grey", color(0x4f5b66), 0.35),
                          make_plain("cart_steel", color(0xb9bcc0), 0.3, 1.0),
                          make_plain("rubber_tyre", color(0x1d1d1f), 0.7)});
}

Model towel_dispenser(Host&, Rng) {
  MeshBuilder builder;
  std::vector<Vec2> outline{Vec2(-0.14, 0.05), Vec2(-0.14, -0.05)};
  for (int i = 1; i < 12; ++i) {
    const double a = kPi * i / 12;
    outline.push_back({-0.14 * std::cos(a), -0.05 - 0.055 * std::sin(a)});
  }
  for (const Vec2& p : {Vec2(0.14, -0.05), Vec2(0.14, 0.05)}) outline.push_back(p);
  builder.begin(at(0, 0, 0.04), {0, 1.0});
  add_prism(builder, outline, 0.30, 0.006);
  builder.begin(at(0, -0.050, 0.038), {1, 1.0});
  add_box(builder, Vec3(0.235, 0.070, 0.014), 0.003, Axis::X, 2);
  builder.begin(at(0, -0.058, 0.018), {2, 1.0});
  add_box(builder, Vec3(0.200, 0.003, 0.046), 0.001, Axis::X);
  builder.begin(at(0, -0.104, 0.250), {1, 1.0});
  add_box(builder, Vec3(0.036, 0.012, 0.020), 0.003, Axis::X, 2);
  return finish(builder, {make_plain("white_abs", color(0xe9ebeb), 0.3),
                          make_plain("smoke_grey", color(0x4b5157), 0.3),
                          make_plain("paper_towel", color(0xf5f4ef), 0.95)});
}

constexpr ModelKind kProps[] = {
    {"SM_CardBoxA_01_414", 0.60, card_box_a},
    {"SM_CardBoxD_04_1847", 0.45, card_box_d},
    {"S_TrafficCone", 0.90, traffic_cone},
    {"S_WetFloorSign", 0.80, wet_floor_sign},
    {"SM_BarrelPlastic_A_01", 1.60, barrel},
    {"SM_CratePlastic_A_01", 1.10, crate},
    {"SM_FireExtinguisher_01", 3.20, fire_extinguisher},
    {"SM_BookStack_01", 1.80, book_stack},
    {"SM_CoffeeCup_01", 0.25, coffee_cup},
    {"SM_DeskLamp_01", 1.10, desk_lamp},
    {"SM_Globe_01", 0.70, globe},
    {"SM_PenHolder_01", 0.22, pen_holder},
    {"SM_PottedPlant_01", 0.65, potted_plant},
    {"SM_Stapler_01", 0.25, stapler},
    {"SM_Tablet_01", 0.48, tablet},
    {"SM_Vase_01", 0.85, vase},
    {"SM_Clipboard_01", 0.35, clipboard},
    {"SM_MedicalBag_01a", 1.40, medical_bag},
    {"SM_MedicalBox_01g", 1.20, medical_box},
    {"SM_PillBottle_01", 0.09, pill_bottle},
    {"SM_BarelPlastic_B_03", 1.30, green_barrel},
    {"SM_Board", 0.90, white_board},
    {"SM_Book_03", 0.75, book_red},
    {"SM_Book_34", 0.38, book_blue},
    {"SM_BookOpen_01", 0.80, open_book},
    {"SM_Briefcase", 2.10, briefcase},
    {"SM_Extinguisher", 3.20, fire_extinguisher},
    {"SM_GasCart_01b", 4.50, gas_cart},
    {"SM_Toweldispenser_01a", 1.20, towel_dispenser},
};

}  // namespace

std::span<const ModelKind> props() { return kProps; }

}  // namespace diorama::samples
