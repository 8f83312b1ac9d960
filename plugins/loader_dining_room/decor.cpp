// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/decor.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "modelling/shapes.h"

namespace diorama::dining_room {

using namespace modelling;

namespace {

constexpr int kRound = 48;  ///< Segments of tableware.

/// A thin wall along an outer contour, from the middle of the foot over the rim back to the middle
/// of the inside.
std::vector<ProfilePoint> shell(std::span<const ProfilePoint> outer, double thickness) {
  std::vector<ProfilePoint> profile{{0, outer.front().z}};
  profile.insert(profile.end(), outer.begin(), outer.end());
  std::vector<ProfilePoint> inner;
  for (std::size_t i = 0; i < outer.size(); ++i) {
    const ProfilePoint& before = outer[i == 0 ? 0 : i - 1];
    const ProfilePoint& after = outer[std::min(i + 1, outer.size() - 1)];
    const Vec2 along = Vec2(after.r - before.r, after.z - before.z).normalized();
    const Vec2 inwards(-along.y(), along.x());
    inner.push_back({std::max(0.002, outer[i].r + thickness * inwards.x()),
                     std::max(outer.front().z + thickness, outer[i].z + thickness * inwards.y())});
  }
  // A rounded rim between the two walls.
  const ProfilePoint& a = outer.back();
  const ProfilePoint& b = inner.back();
  profile.push_back({(a.r + b.r) / 2, (a.z + b.z) / 2 + thickness * 0.45});
  for (std::size_t i = inner.size(); i-- > 0;) {
    if (inner[i].z <= outer.front().z + thickness * 1.001 && i + 1 < inner.size() &&
        inner[i + 1].z <= outer.front().z + thickness * 1.001) {
      continue;
    }
    profile.push_back(inner[i]);
  }
  profile.push_back({0, std::max(outer.front().z + thickness, inner.front().z)});
  return profile;
}

std::vector<ProfilePoint> smooth_profile(std::span<const ProfilePoint> knots, int steps) {
  std::vector<Vec3> points;
  for (const ProfilePoint& k : knots) points.emplace_back(k.r, 0, k.z);
  std::vector<ProfilePoint> result;
  for (const Vec3& p : smooth_path(points, steps))
    result.push_back({std::max(0.001, p.x()), p.z()});
  return result;
}

void add_shell(MeshBuilder& builder, std::span<const ProfilePoint> knots, double thickness,
               int steps = 6) {
  add_lathe(builder, shell(smooth_profile(knots, steps), thickness), kRound, 0.9);
}

/// A leaf from `root`, arching over towards `out`.
void add_leaf(MeshBuilder& builder, const Vec3& root, double angle, double length, double width,
              double rise, double droop) {
  const Vec3 out(std::cos(angle), std::sin(angle), 0);
  const Vec3 side(-std::sin(angle), std::cos(angle), 0);
  const auto surface = [&](double u, double v) {
    const double shape = std::max(0.15, std::pow(std::sin(kPi * (0.05 + 0.92 * v)), 0.8));
    const double x = (2 * u - 1) * width / 2 * shape;
    const double fold = 0.5 * x * x / width;
    return Vec3(root + out * length * v * (1 - 0.25 * v) +
                Vec3(0, 0, length * (rise * v - droop * v * v)) + side * x + Vec3(0, 0, fold));
  };
  add_sheet(builder, 4, 10, 0.0008, surface, Vec2(width, length));
}

}  // namespace

Piece build_rug(const Vec2& size, double thickness, bool is_round, Host& host, Rng rng) {
  (void)host;
  MeshBuilder builder;
  const double longest = std::max(size.x(), size.y());
  const auto pixels = [&](double metres) {
    return std::max(64, int(768 * metres / longest) / 4 * 4);
  };
  const int height = is_round ? 768 : pixels(size.y());
  const MaterialPtr material = make_picture_material(
      "shader_rug", make_rug(rng.fork("pattern"), is_round ? 768 : pixels(size.x()), height), 0.98);
  if (is_round) {
    const double diameter = std::min(size.x(), size.y());
    builder.begin(Affine::Identity(), {0, 1 / diameter, Vec2(0.5, 0.5)});
    std::vector<Vec2> outline;
    for (int i = 0; i < 96; ++i) {
      const double a = 2 * kPi * i / 96;
      outline.emplace_back(diameter / 2 * std::cos(a), diameter / 2 * std::sin(a));
    }
    add_prism(builder, outline, thickness, 0.004);
    return finish(builder, {material});
  }
  builder.begin(at(0, 0, thickness / 2), {0, 1.0});
  const UvRect edge{Vec2(0.004, 0.004), Vec2(0.996, 0.012)};
  add_printed_box(builder, Vec3(size.x(), size.y(), thickness), 0.004,
                  {edge, edge, edge, edge, edge, UvRect{}}, 2);
  return finish(builder, {material});
}

Piece build_plate(const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double r = rng.uniform(0.115, 0.138);
  const std::array<ProfilePoint, 6> outer{{{0.055, 0},
                                           {0.058, 0.004},
                                           {0.075, 0.006},
                                           {0.72 * r, 0.009},
                                           {0.88 * r, 0.017},
                                           {r, 0.022}}};
  add_shell(builder, outer, 0.0038, 4);
  return finish(builder, {m.porcelain.material});
}

Piece build_bowl(const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double r = rng.uniform(0.07, 0.09), h = rng.uniform(0.055, 0.08);
  const std::array<ProfilePoint, 6> outer{{{0.4 * r, 0},
                                           {0.42 * r, 0.006},
                                           {0.62 * r, 0.014},
                                           {0.84 * r, 0.4 * h},
                                           {0.95 * r, 0.72 * h},
                                           {r, h}}};
  add_shell(builder, outer, 0.004);
  return finish(builder, {m.porcelain.material});
}

Piece build_fruit_bowl(const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double r = 0.135;
  const std::array<ProfilePoint, 5> outer{
      {{0.06, 0}, {0.064, 0.010}, {0.098, 0.022}, {0.124, 0.05}, {r, 0.085}}};
  add_shell(builder, outer, 0.005);
  // Fruit in two layers, each resting on the bowl or in the hollow between three others.
  const double fruit = 0.036;
  const auto add = [&](double x, double y, double z, std::uint16_t slot, double squash) {
    builder.begin(at(x, y, z) * turned_z(rng.uniform(0, 6)) * turned_x(rng.uniform(-0.4, 0.4)),
                  {slot, 1.0});
    std::vector<ProfilePoint> profile;
    for (int i = 0; i <= 16; ++i) {
      const double a = kPi * i / 16;
      const double dimple = 0.010 * std::exp(-14 * std::pow(std::sin(a), 2.0));
      profile.push_back({i == 0 || i == 16 ? 0.0 : fruit * std::sin(a),
                         -(fruit * squash - dimple) * std::cos(a)});
    }
    add_lathe(builder, profile, 24, 3.0);
  };
  for (int i = 0; i < 5; ++i) {
    const double a = 2 * kPi * i / 5;
    add(0.066 * std::cos(a), 0.066 * std::sin(a), 0.058, std::uint16_t(1 + i % 2), 0.93);
  }
  add(0.0, 0.0, 0.102, rng.chance(0.5) ? 1 : 2, 0.95);
  return finish(builder, {m.earthenware.material, m.fruit_a.material, m.fruit_b.material});
}

Piece build_wineglass(const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double h = rng.uniform(0.17, 0.21), r = rng.uniform(0.036, 0.043), bowl = h * 0.48;
  std::vector<ProfilePoint> profile{
      {0, 0},         {0.033, 0},     {0.0335, 0.0015},           {0.02, 0.004},
      {0.006, 0.009}, {0.0038, 0.02}, {0.0038, h - bowl - 0.012}, {0.007, h - bowl - 0.003}};
  const std::array<ProfilePoint, 6> cup{{{0.010, h - bowl},
                                         {0.024, h - bowl * 0.86},
                                         {r, h - bowl * 0.55},
                                         {r, h - bowl * 0.4},
                                         {r * 0.93, h - bowl * 0.15},
                                         {r * 0.86, h}}};
  const std::vector<ProfilePoint> outer = smooth_profile(cup, 5);
  const std::vector<ProfilePoint> wall = shell(outer, 0.0014);
  profile.insert(profile.end(), wall.begin() + 1, wall.end());
  add_lathe(builder, profile, kRound, 0.9);
  return finish(builder, {m.glass.material});
}

Piece build_cup(const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double r = rng.uniform(0.036, 0.043), h = rng.uniform(0.075, 0.095);
  const std::array<ProfilePoint, 5> outer{
      {{0.75 * r, 0}, {0.92 * r, 0.008}, {r, 0.03}, {r, 0.7 * h}, {0.99 * r, h}}};
  add_shell(builder, outer, 0.0032);
  const std::array<Vec3, 5> ear{Vec3(r - 0.0015, 0, 0.78 * h), Vec3(r + 0.016, 0, 0.80 * h),
                                Vec3(r + 0.026, 0, 0.55 * h), Vec3(r + 0.016, 0, 0.30 * h),
                                Vec3(r - 0.0015, 0, 0.27 * h)};
  std::vector<PathPoint> path;
  for (const Vec3& p : smooth_path(ear, 6)) path.push_back({p, 0.0055, 0.0035});
  add_sweep(builder, path, 14, Vec3::UnitX());
  return finish(builder, {m.earthenware.material});
}

Piece build_vase(const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double h = rng.uniform(0.18, 0.34);
  const double belly = h * rng.uniform(0.20, 0.34), neck = belly * rng.uniform(0.35, 0.75);
  const double at_belly = rng.uniform(0.3, 0.6);
  const std::array<ProfilePoint, 6> outer{{{belly * 0.6, 0},
                                           {belly * 0.7, h * 0.05},
                                           {belly, h * at_belly},
                                           {belly * 0.85, h * (at_belly + 0.16)},
                                           {neck, h * 0.88},
                                           {neck * rng.uniform(1.05, 1.4), h}}};
  add_shell(builder, outer, 0.005, 8);
  if (rng.chance(0.5)) {
    // Dry twigs.
    for (int i = 0; i < 7; ++i) {
      const double a = rng.uniform(0, 2 * kPi), lean = rng.uniform(0.05, 0.14);
      const Vec3 out(std::cos(a), std::sin(a), 0);
      const std::array<Vec3, 4> knots{
          Vec3(out * neck * 0.1 + Vec3(0, 0, 0.03)), Vec3(out * neck * 0.6 + Vec3(0, 0, h * 0.95)),
          Vec3(out * (neck * 0.6 + lean * 0.6) + Vec3(0, 0, h + 0.16)),
          Vec3(out * (neck * 0.6 + lean) + Vec3(0, 0, h + rng.uniform(0.24, 0.34)))};
      builder.begin(Affine::Identity(), {1, 1.0});
      std::vector<PathPoint> path;
      const auto curve = smooth_path(knots, 5);
      for (std::size_t k = 0; k < curve.size(); ++k) {
        const double r = std::lerp(0.0026, 0.0010, double(k) / double(curve.size() - 1));
        path.push_back({curve[k], r, r});
      }
      add_sweep(builder, path, 7);
      for (int leaf = 0; leaf < 5; ++leaf) {
        builder.begin(Affine::Identity(), {1, 1.0});
        const Vec3 root = curve[curve.size() - 1 - std::size_t(leaf) * 1];
        add_leaf(builder, root, a + (leaf % 2 == 0 ? 1.0 : -1.0) * rng.uniform(0.6, 1.4), 0.055,
                 0.022, 0.6, 0.3);
      }
    }
  }
  return finish(builder, {m.earthenware.material, m.leaf.material});
}

Piece build_candlestick(const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double h = rng.uniform(0.12, 0.22);
  const std::array<ProfilePoint, 12> stick{{{0, 0},
                                            {0.042, 0},
                                            {0.043, 0.006},
                                            {0.018, 0.014},
                                            {0.008, 0.03},
                                            {0.007, 0.5 * h},
                                            {0.011, 0.55 * h},
                                            {0.007, 0.6 * h},
                                            {0.008, h - 0.02},
                                            {0.020, h - 0.008},
                                            {0.020, h},
                                            {0, h}}};
  add_lathe(builder, stick, 32, 0.8);
  builder.begin(at(0, 0, h), {1, 1.0});
  const double c = rng.uniform(0.10, 0.2);
  const std::array<ProfilePoint, 5> candle{
      {{0, 0}, {0.0105, 0}, {0.0100, c - 0.004}, {0.006, c}, {0, c - 0.003}}};
  add_lathe(builder, candle, 24, 0.8);
  return finish(builder, {m.brass.material, m.wax.material});
}

Piece build_cutlery(Cutlery kind, const RoomMaterials& m) {
  MeshBuilder builder;
  builder.begin(at(0, 0, 0.0035), {});
  std::vector<PathPoint> path;
  const auto add = [&](double y, double z, double half_width, double half_height) {
    path.push_back({Vec3(0, y, z), half_width, half_height});
  };
  add(-0.100, 0, 0.006, 0.0022);
  add(-0.096, 0, 0.0095, 0.0026);
  add(-0.06, 0, 0.0085, 0.0026);
  add(-0.01, 0.001, 0.0045, 0.0024);
  add(0.015, 0.002, 0.004, 0.0024);
  if (kind == Cutlery::Spoon) {
    for (int i = 1; i <= 8; ++i) {
      const double t = i / 8.0;
      add(0.02 + 0.062 * t, 0.0015, std::max(0.004, 0.020 * std::sin(kPi * (0.12 + 0.82 * t))),
          0.0022);
    }
  } else if (kind == Cutlery::Knife) {
    add(0.03, 0.001, 0.010, 0.0011);
    add(0.09, 0.001, 0.0095, 0.0010);
    add(0.112, 0.001, 0.003, 0.0009);
  } else {
    add(0.03, 0.002, 0.011, 0.0014);
    add(0.048, 0.002, 0.0122, 0.0013);
  }
  add_sweep(builder, path, 20, Vec3::UnitZ(), 3.0);
  if (kind == Cutlery::Fork) {
    for (int i = 0; i < 4; ++i) {
      const double x = (i - 1.5) * 0.0066;
      const std::array<PathPoint, 3> tine{PathPoint{Vec3(x, 0.046, 0.002), 0.0022, 0.0013},
                                          PathPoint{Vec3(x, 0.07, 0.0012), 0.0019, 0.0012},
                                          PathPoint{Vec3(x, 0.098, 0.002), 0.0008, 0.0008}};
      add_sweep(builder, tine, 10, Vec3::UnitZ(), 3.0);
    }
  }
  return finish(builder, {m.steel.material});
}

Piece build_plant(double height, const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  const double pot = std::min(0.34, height * 0.34), r = pot * 0.46;
  const std::array<ProfilePoint, 4> outer{
      {{r * 0.7, 0}, {r * 0.78, pot * 0.1}, {r * 0.97, pot * 0.88}, {r, pot}}};
  add_shell(builder, outer, 0.008, 5);
  builder.begin(at(0, 0, pot * 0.80), {1, 1.0});
  const std::array<ProfilePoint, 4> soil{{{0, 0}, {r * 0.88, 0}, {r * 0.86, 0.012}, {0, 0.022}}};
  add_lathe(builder, soil, 32, 0.3);
  const double ground = pot * 0.80 + 0.015;
  const int kind = int(rng.index(3));
  if (kind == 0) {  // upright blades
    for (int i = 0; i < 16; ++i) {
      const double a = rng.uniform(0, 2 * kPi);
      builder.begin(Affine::Identity(), {2, 1.0});
      const Vec3 root(0.35 * r * std::cos(a * 3.1), 0.35 * r * std::sin(a * 3.1), ground);
      const double length = (height - ground) * rng.uniform(0.55, 1.0);
      add_leaf(builder, root, a, length * rng.uniform(0.25, 0.45), 0.05,
               length / 0.30 * 0.8 / std::max(0.3, length), 0.15);
    }
  } else {  // stems with leaves
    const int stems = kind == 1 ? 9 : 5;
    for (int i = 0; i < stems; ++i) {
      const double a = 2 * kPi * (i + rng.uniform(0, 0.6)) / stems;
      const double top = ground + (height - ground) * rng.uniform(0.55, 1.0);
      const double lean = (kind == 1 ? 0.30 : 0.18) * (height - ground) * rng.uniform(0.4, 1.0);
      const Vec3 out(std::cos(a), std::sin(a), 0);
      const std::array<Vec3, 4> knots{
          Vec3(out * r * 0.2 + Vec3(0, 0, ground - 0.01)),
          Vec3(out * (r * 0.3 + lean * 0.2) + Vec3(0, 0, std::lerp(ground, top, 0.4))),
          Vec3(out * (r * 0.3 + lean * 0.6) + Vec3(0, 0, std::lerp(ground, top, 0.75))),
          Vec3(out * (r * 0.3 + lean) + Vec3(0, 0, top))};
      const auto curve = smooth_path(knots, 5);
      builder.begin(Affine::Identity(), {2, 1.0});
      add_tube(builder, curve, 0.0045, 8);
      const double size = height * (kind == 1 ? 0.22 : 0.15);
      const std::size_t leaves = kind == 1 ? 2 : 7;
      for (std::size_t k = 0; k < leaves; ++k) {
        builder.begin(Affine::Identity(), {2, 1.0});
        const Vec3& root = curve[curve.size() - 1 - k * (kind == 1 ? 3 : 1)];
        add_leaf(builder, root, a + rng.uniform(-1.2, 1.2), size * rng.uniform(0.7, 1.0),
                 size * 0.5, rng.uniform(0.2, 0.6), 0.7);
      }
    }
  }
  return finish(builder, {m.earthenware.material, m.soil.material, m.leaf.material});
}

namespace {

/// One closed book: its spine at y = -depth, its foot on z = 0, from x = 0 to `thick`.
void add_book(MeshBuilder& builder, const Affine& pose, double thick, double depth, double height,
              int spine) {
  constexpr double kCover = 0.0025, kInset = 0.003;
  const double u0 = double(spine) / kSpinesPerTexture, u1 = double(spine + 1) / kSpinesPerTexture;
  const UvRect plain{Vec2(u0 + 0.2 / kSpinesPerTexture, 0.20),
                     Vec2(u1 - 0.2 / kSpinesPerTexture, 0.26)};
  const UvRect back{Vec2(u0 + 0.002, 0.0), Vec2(u1 - 0.002, 1.0)};
  const auto board = [&](const Vec3& low, const Vec3& high, const UvRect& front) {
    builder.begin(pose * at((low + high) / 2), {0, 1.0});
    add_printed_box(builder, high - low, 0.0008, {plain, plain, front, plain, plain, plain});
  };
  board({0, -depth, 0}, {thick, -depth + kCover, height}, back);
  board({0, -depth + kCover, 0}, {kCover, 0, height}, plain);
  board({thick - kCover, -depth + kCover, 0}, {thick, 0, height}, plain);
  builder.begin(pose * at(thick / 2, (-depth + kCover - kInset) / 2, height / 2), {1, 1.0});
  add_box(builder, Vec3(thick - 2 * kCover, depth - kCover - kInset, height - 2 * kInset), 0.0005,
          Axis::Z);
}

}  // namespace

Piece build_books(double width, double max_height, double depth, const RoomMaterials& m,
                  const MaterialPtr& spines, Rng rng) {
  MeshBuilder builder;
  double x = 0.0;
  while (true) {
    const double thick = rng.uniform(0.016, 0.048);
    const double height = std::min(max_height - 0.02, rng.uniform(0.18, 0.27));
    const double deep = std::min(depth, rng.uniform(0.13, 0.19));
    const int spine = int(rng.index(kSpinesPerTexture));
    if (x + thick > width && x > 0) break;
    add_book(builder, at(x, -depth + deep, 0), thick, deep, height, spine);
    x += thick + 0.0006;
  }
  return finish(builder, {spines, m.paper.material});
}

Piece build_book_stack(const RoomMaterials& m, const MaterialPtr& spines, Rng rng) {
  MeshBuilder builder;
  double z = 0.0;
  const int count = 2 + int(rng.index(3));
  for (int i = 0; i < count; ++i) {
    const double thick = rng.uniform(0.018, 0.04), height = 0.26 - 0.02 * i,
                 depth = 0.19 - 0.012 * i;
    // Lying: the book's x runs up.
    const Affine lying = at(0, 0, z) * turned_z(rng.uniform(-0.12, 0.12)) *
                         at(height / 2, depth / 2, 0) * turned_y(-kPi / 2);
    add_book(builder, lying, thick, depth, height, int(rng.index(kSpinesPerTexture)));
    z += thick;
  }
  return finish(builder, {spines, m.paper.material});
}

Piece build_picture(double width, double height, const RoomMaterials& m, Host& host, Rng rng) {
  (void)host;
  MeshBuilder builder;
  const double rail = rng.uniform(0.02, 0.045), deep = 0.028;
  const Affine upright = turned_x(kPi / 2);  // xy becomes xz, z becomes -y
  builder.begin(upright, {0, m.table_wood.repeats_per_m});
  const std::array<Vec2, 6> section{Vec2(0, 0),
                                    Vec2(rail, 0),
                                    Vec2(rail, 0.012),
                                    Vec2(rail * 0.7, deep * 0.8),
                                    Vec2(rail * 0.3, deep),
                                    Vec2(0, deep * 0.9)};
  const double w = width / 2, h = height / 2;
  const std::array<Vec2, 4> path{Vec2(-w, -h), Vec2(w, -h), Vec2(w, h), Vec2(-w, h)};
  add_moulding(builder, section, path, true);
  const bool is_mounted = rng.chance(0.5);
  const double mount = is_mounted ? 0.14 * std::min(width, height) : 0.0;
  const Vec2 inner(width - 2 * rail, height - 2 * rail);
  builder.begin(at(0, -0.004, 0), {1, 1.0});
  add_box(builder, Vec3(inner.x(), 0.008, inner.y()), 0.0005, Axis::X);
  const Vec2 art = inner - Vec2::Constant(2 * mount);
  builder.begin(at(0, -0.0085, 0), {2, 1.0});
  const UvRect edge{Vec2(0.01, 0.01), Vec2(0.02, 0.02)};
  add_printed_box(builder, Vec3(art.x(), 0.001, art.y()), 0.0002,
                  {edge, edge, UvRect{}, edge, edge, edge});
  const int px = 512;
  const int py = std::clamp(int(px * art.y() / art.x()) / 4 * 4, 128, 1024);
  const MaterialPtr canvas =
      make_picture_material("shader_painting", make_painting(rng.fork("art"), px, py), 0.6);
  const MaterialPtr frame = rng.chance(0.5)   ? m.table_wood.material
                            : rng.chance(0.5) ? m.brass.material
                                              : m.leg_metal.material;
  return finish(builder, {frame, m.paper.material, canvas});
}

Vec3f black_body_color(double kelvin) {
  const double t = kelvin;
  const double u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t * t) /
                   (1 + 8.42420235e-4 * t + 7.08145163e-7 * t * t);
  const double v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t * t) /
                   (1 - 2.89741816e-5 * t + 1.61456053e-7 * t * t);
  const double x = 3 * u / (2 * u - 8 * v + 4), y = 2 * v / (2 * u - 8 * v + 4);
  const Vec3 xyz(x / y, 1.0, (1 - x - y) / y);
  Mat3 rgb_from_xyz;  // Rec. 709 primaries, D65
  rgb_from_xyz << 3.2404542, -1.5371385, -0.4985314, -0.9692660, 1.8760108, 0.0415560, 0.0556434,
      -0.2040259, 1.0572252;
  const Vec3 rgb = (rgb_from_xyz * xyz).cwiseMax(0.0);
  const double luminance = rgb.dot(Vec3(0.2126, 0.7152, 0.0722));
  return (rgb / luminance).cast<float>();
}

CeilingLight build_ceiling_light(const RoomMaterials& m, Rng rng) {
  CeilingLight light;
  MeshBuilder body, glass;
  body.begin(Affine::Identity(), {1, 1.0});
  light.kelvin = rng.uniform(3500, 6000);
  light.lumens = rng.uniform(1000, 2200);
  const int kind = int(rng.index(3));
  if (kind == 0) {  // a flush dish with a glass bowl
    const double r = rng.uniform(0.17, 0.24);
    const std::array<ProfilePoint, 7> dish{{{0, -0.030},
                                            {r * 0.8, -0.030},
                                            {r * 0.98, -0.045},
                                            {r, -0.048},
                                            {r * 1.02, -0.040},
                                            {r, 0},
                                            {0, 0}}};
    add_lathe(body, dish, 64, 0.7);
    const std::array<ProfilePoint, 6> bowl{{{0.001, -0.115},
                                            {r * 0.4, -0.110},
                                            {r * 0.7, -0.093},
                                            {r * 0.88, -0.068},
                                            {r * 0.94, -0.053},
                                            {r * 0.95, -0.046}}};
    glass.begin(Affine::Identity(), {});
    add_lathe(glass, shell(smooth_profile(bowl, 4), 0.003), 64, 0.9);
    light.bulb = Vec3(0, 0, -0.072);
    light.bulb_radius = 0.03;
  } else {
    const double drop = rng.uniform(0.22, 0.36);
    const std::array<ProfilePoint, 5> rose{
        {{0, -0.028}, {0.03, -0.026}, {0.05, -0.012}, {0.052, 0}, {0, 0}}};
    add_lathe(body, rose, 40, 0.8);
    body.begin(Affine::Identity(), {1, 1.0});
    const std::array<Vec3, 2> cord{Vec3(0, 0, -0.02), Vec3(0, 0, -drop + 0.02)};
    add_tube(body, cord, 0.004, 10);
    const std::array<ProfilePoint, 4> socket{
        {{0, -drop - 0.035}, {0.021, -drop - 0.035}, {0.021, -drop + 0.02}, {0, -drop + 0.026}}};
    body.begin(Affine::Identity(), {1, 1.0});
    add_lathe(body, socket, 24, 0.5);
    const double r = rng.uniform(0.16, 0.23);
    body.begin(Affine::Identity(), {0, m.lampshade.repeats_per_m});
    if (kind == 1) {  // a dome of metal or porcelain
      std::vector<ProfilePoint> ring;
      for (int i = 0; i <= 16; ++i) {
        const double a = kPi / 2 * (1 - i / 16.0);
        ring.push_back(
            {0.024 + (r - 0.024) * std::sin(a), -drop - r * 0.75 + r * 0.75 * std::cos(a)});
      }
      const std::size_t outer = ring.size();
      for (std::size_t i = outer; i-- > 0;)
        ring.push_back({std::max(0.022, ring[i].r - 0.003), ring[i].z - 0.003});
      ring.push_back(ring.front());
      add_lathe(body, ring, 64, 0.8);
    } else {  // a drum of fabric with a spider
      const double h = 0.20, top = -drop + 0.03;
      const std::array<ProfilePoint, 5> ring{{{r, top - h},
                                              {r * 0.94, top},
                                              {r * 0.94 - 0.002, top},
                                              {r - 0.002, top - h},
                                              {r, top - h}}};
      add_lathe(body, ring, 64, 0.5);
      for (int i = 0; i < 3; ++i) {
        const double a = 2 * kPi * i / 3;
        body.begin(Affine::Identity(), {1, 1.0});
        const std::array<Vec3, 2> spoke{
            Vec3(0.015 * std::cos(a), 0.015 * std::sin(a), -drop + 0.012),
            Vec3(r * 0.94 * std::cos(a), r * 0.94 * std::sin(a), top - 0.012)};
        add_tube(body, spoke, 0.0025, 8);
      }
    }
    const double neck = -drop - 0.034;
    const std::array<ProfilePoint, 6> bulb{{{0.001, neck - 0.095},
                                            {0.018, neck - 0.088},
                                            {0.031, neck - 0.062},
                                            {0.026, neck - 0.035},
                                            {0.014, neck - 0.012},
                                            {0.0135, neck}}};
    glass.begin(Affine::Identity(), {});
    add_lathe(glass, shell(smooth_profile(bulb, 5), 0.0012), 32, 0.9);
    light.bulb = Vec3(0, 0, neck - 0.058);
    light.bulb_radius = 0.026;
  }
  const MaterialPtr shade = kind == 1 ? (rng.chance(0.5) ? m.shell.material : m.leg_metal.material)
                                      : m.lampshade.material;
  light.body = finish(body, {shade, m.brass.material});
  light.glass = finish(glass, {m.frosted.material});
  return light;
}

CeilingLight build_table_lamp(const RoomMaterials& m, Rng rng) {
  CeilingLight light;
  MeshBuilder body, glass;
  const double h = rng.uniform(0.22, 0.30);
  body.begin(Affine::Identity(), {2, 1.0});
  const double belly = rng.uniform(0.06, 0.09);
  const std::array<ProfilePoint, 5> knots{{{belly * 0.75, 0},
                                           {belly * 0.8, 0.012},
                                           {belly, h * 0.4},
                                           {belly * 0.5, h * 0.8},
                                           {0.012, h}}};
  std::vector<ProfilePoint> foot{{0, 0}};
  for (const ProfilePoint& p : smooth_profile(knots, 6)) foot.push_back(p);
  foot.push_back({0.012, h + 0.05});
  foot.push_back({0, h + 0.05});
  add_lathe(body, foot, 40, 0.8);
  const double low = h + 0.02, high = low + 0.19, r = 0.14;
  body.begin(Affine::Identity(), {0, m.lampshade.repeats_per_m});
  const std::array<ProfilePoint, 5> shade{
      {{r, low}, {r * 0.7, high}, {r * 0.7 - 0.002, high}, {r - 0.002, low}, {r, low}}};
  add_lathe(body, shade, 64, 0.5);
  for (int i = 0; i < 3; ++i) {
    const double a = 2 * kPi * i / 3;
    const double at_z = low + 0.03;
    const double rim = std::lerp(r, r * 0.7, 0.03 / 0.19) - 0.001;
    body.begin(Affine::Identity(), {1, 1.0});
    const std::array<Vec3, 2> spoke{Vec3(0.008 * std::cos(a), 0.008 * std::sin(a), h + 0.045),
                                    Vec3(rim * std::cos(a), rim * std::sin(a), at_z)};
    add_tube(body, spoke, 0.002, 8);
  }
  const double neck = h + 0.05;
  const std::array<ProfilePoint, 6> bulb{{{0.0135, neck},
                                          {0.014, neck + 0.01},
                                          {0.024, neck + 0.03},
                                          {0.027, neck + 0.05},
                                          {0.016, neck + 0.072},
                                          {0.001, neck + 0.078}}};
  glass.begin(Affine::Identity(), {});
  std::vector<ProfilePoint> closed{{0, neck}};
  for (const ProfilePoint& p : smooth_profile(bulb, 5)) closed.push_back(p);
  closed.push_back({0, neck + 0.0782});
  add_lathe(glass, closed, 28, 0.9);
  light.body = finish(body, {m.lampshade.material, m.brass.material, m.earthenware.material});
  light.glass = finish(glass, {m.frosted.material});
  light.bulb = Vec3(0, 0, neck + 0.045);
  light.bulb_radius = 0.02;
  light.lumens = rng.uniform(350, 600);
  light.kelvin = rng.uniform(3000, 3600);
  return light;
}

}  // namespace diorama::dining_room
