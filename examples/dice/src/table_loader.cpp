// SPDX-License-Identifier: Apache-2.0
#include "table_loader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "die_loader.h"
#include "patterns.h"

namespace dice {

using diorama::Affine;
using diorama::Mesh;
using diorama::NodeId;
using diorama::Rng;
using diorama::Scene;
using diorama::Vec3;

namespace {

using MaterialPtr = std::shared_ptr<const diorama::Material>;

constexpr std::string_view kAny = "dice_table:";
constexpr std::string_view kPlain = "plain_table:";
constexpr double kTable_m = 2.4;
constexpr int kPixels = 400;

/// Puts simple bodies below one node.
class Builder {
 public:
  Builder(Scene& scene, NodeId root) : scene_(scene), root_(root) {}

  NodeId box(const char* name, const Vec3& size, const Affine& pose, const MaterialPtr& material) {
    return add(name, std::make_shared<Mesh>(diorama::make_box(size)), pose, material);
  }
  NodeId disc(const char* name, double radius, double height, const Affine& pose,
              const MaterialPtr& material) {
    return add(name, std::make_shared<Mesh>(diorama::make_cylinder(radius, height, 32)), pose,
               material);
  }

 private:
  NodeId add(const char* name, std::shared_ptr<const Mesh> mesh, const Affine& pose,
             const MaterialPtr& material) {
    const NodeId node = scene_.create(root_, name);
    scene_.edit(node).mesh = std::move(mesh);
    scene_.edit(node).materials = {material};
    scene_.set_pose(node, pose);
    return node;
  }

  Scene& scene_;
  NodeId root_;
};

Affine at(double x, double y, double z, double turn_rad = 0.0) {
  return Affine(Eigen::Translation3d(x, y, z) * Eigen::AngleAxisd(turn_rad, Vec3::UnitZ()));
}

std::shared_ptr<diorama::Material> coated(const Color& color, double roughness) {
  auto material = std::make_shared<diorama::Material>();
  material->name = "surface";
  material->base_color = linear(color);
  material->roughness = float(roughness);
  return material;
}

/// A pattern that covers `repeat_m` of a face of `size_m`, and goes on mirrored.
MaterialPtr patterned(double size_m, double repeat_m, double roughness,
                      const std::function<Color(double u, double v)>& pattern) {
  auto material = coated(Color::Ones(), roughness);
  auto& input = material->base_color_texture;
  input.texture = painted("surface", kPixels, kPixels,
                          [&](double x, double y) { return pattern(x / kPixels, y / kPixels); });
  input.wrap_u = input.wrap_v = diorama::Wrap::Mirror;
  input.uv_from_mesh_uv *= float(size_m / repeat_m);
  return material;
}

Color white(Rng& rng) {
  return from_hsv(rng.uniform(), 0.06 * rng.uniform(), rng.uniform(0.62, 1.0));
}

/// Paper, card and plastic: clouds of light, fibres, and specks of dirt.
MaterialPtr sheet(Rng& rng, const Color& color, double size_m) {
  const std::uint64_t seed = rng.bits();
  const double clouds = rng.uniform(0.0, 0.06), grain = rng.uniform(0.0, 0.05);
  const double specks = rng.chance(0.6) ? rng.uniform(0.02, 0.07) : 0.0;
  return patterned(size_m, 0.32, rng.uniform(0.25, 0.95), [=](double u, double v) {
    const Vec3 p(u, v, 0.0);
    double shade = 1.0 + clouds * noise(seed, 5.0 * p, 2) + grain * noise(seed + 9, 150.0 * p);
    if (specks > 0.0) {
      const NearestPoint speck = nearest_point(seed + 5, Vec3(18.0 * u, 18.0 * v, 0.5));
      const double size = specks * double(speck.number % 64) / 64.0;
      if (speck.number % 5 == 0 && speck.distance < size) shade *= 0.5;
    }
    return Color(color * float(shade));
  });
}

MaterialPtr wood(Rng& rng, double size_m) {
  const std::uint64_t seed = rng.bits();
  const Color light =
      from_hsv(rng.uniform(0.04, 0.11), rng.uniform(0.2, 0.7), rng.uniform(0.35, 0.9));
  const Color dark = light * float(rng.uniform(0.4, 0.85));
  const double rings = rng.uniform(6.0, 25.0), planks = rng.uniform(2.0, 6.0);
  const bool has_planks = rng.chance(0.4);
  return patterned(size_m, 0.4, rng.uniform(0.2, 0.7), [=](double u, double v) {
    const double plank = has_planks ? std::floor(v * planks) : 0.0;
    const Vec3 p(1.2 * u + 7.0 * plank, 9.0 * v, plank);
    const double ring = 0.5 + 0.5 * std::sin(rings * (v + 0.25 * noise(seed, p, 3)));
    const double fibre = noise(seed + 7, Vec3(9.0 * u, 180.0 * v, plank), 2);
    const double joint = has_planks && v * planks - plank < 0.03 ? 0.5 : 1.0;
    return Color(mix(light, dark, std::clamp(0.7 * ring + 0.35 * fibre, 0.0, 1.0)) * float(joint));
  });
}

MaterialPtr cloth(Rng& rng, double size_m) {
  const std::uint64_t seed = rng.bits();
  const Color color = any_color(rng);
  const double threads = rng.uniform(40.0, 160.0), relief = rng.uniform(0.05, 0.35);
  return patterned(size_m, 0.25, 1.0, [=](double u, double v) {
    const double weave =
        std::sin(threads * 2.0 * diorama::kPi * u) * std::sin(threads * 2.0 * diorama::kPi * v);
    const double fuzz = noise(seed, Vec3(90.0 * u, 90.0 * v, 0.0), 2);
    return Color(color * float(1.0 + relief * (0.5 * weave + 0.5 * fuzz)));
  });
}

/// Boards, mats and printed covers: fields, stripes and discs of a few colours.
MaterialPtr print(Rng& rng, double size_m, double repeat_m) {
  const std::uint64_t seed = rng.bits();
  const std::array<Color, 4> inks{any_color(rng), any_color(rng), any_color(rng), white(rng)};
  const int kind = int(rng.index(4));
  const double fields = rng.uniform(2.0, 9.0), size = rng.uniform(0.1, 0.45);
  return patterned(size_m, repeat_m, rng.uniform(0.15, 0.8), [=](double u, double v) {
    const double x = fields * u, y = fields * v;
    const auto ink = [&](std::uint64_t number) { return inks[number % 4]; };
    if (kind == 0) return ink(std::uint64_t(std::floor(x)) + std::uint64_t(std::floor(y)));
    if (kind == 1) return ink(std::uint64_t(std::floor(3.0 * x)));
    const NearestPoint spot = nearest_point(seed, Vec3(x, y, 0.5));
    if (kind == 2) return spot.distance < size ? ink(1 + spot.number % 3) : inks[0];
    const Vec3 p(x, y, 0.0);
    return mix(inks[0], mix(inks[1], inks[2], 0.5 + 0.5 * noise(seed + 1, p, 4)),
               smooth_step(-0.2, 0.2, noise(seed, p, 4)));
  });
}

MaterialPtr any_surface(Rng& rng, double size_m) {
  const double kind = rng.uniform();
  if (kind < 0.70) return sheet(rng, white(rng), size_m);
  if (kind < 0.78) return sheet(rng, any_color(rng), size_m);
  if (kind < 0.88) return wood(rng, size_m);
  if (kind < 0.95) return cloth(rng, size_m);
  return print(rng, size_m, rng.uniform(0.1, 0.5));
}

/// Four walls round the area, in two layers: what lines the inside and what shows outside.
void add_tray(Rng& rng, Builder& builder, double half_x, double half_y) {
  const double height = rng.uniform(0.008, 0.05);
  const double inner = rng.uniform(0.001, 0.004), outer = rng.uniform(0.0015, 0.006);
  const MaterialPtr lining = rng.chance(0.6) ? sheet(rng, white(rng), 0.3) : any_surface(rng, 0.3);
  const bool is_printed = rng.chance(0.4);
  const MaterialPtr cover = is_printed ? print(rng, 0.3, 0.15) : any_surface(rng, 0.3);
  for (int side = 0; side < 4; ++side) {
    const bool along_y = side % 2 == 1;
    const double sign = side < 2 ? 1.0 : -1.0;
    const double reach = along_y ? half_x : half_y, length = 2.0 * (along_y ? half_y : half_x);
    const auto wall = [&](const char* name, double from, double to, double top,
                          const MaterialPtr& material) {
      const double middle = sign * (reach + 0.5 * (from + to));
      const double all = length + 2.0 * to;
      const Vec3 size = along_y ? Vec3(to - from, all, top) : Vec3(all, to - from, top);
      builder.box(name, size,
                  along_y ? at(middle, 0.0, 0.5 * top - 0.002) : at(0.0, middle, 0.5 * top - 0.002),
                  material);
    };
    wall("lining", 0.0, inner, height, lining);
    wall("cover", inner, inner + outer, height + 0.0005, cover);
  }
}

/// A strip with a knob at each end, as boxes have for handles and feet.
void add_strip(Rng& rng, Builder& builder, double x, double y, double turn, double floor) {
  const double length = rng.uniform(0.1, 0.32), width = rng.uniform(0.015, 0.05);
  const double height = rng.uniform(0.001, 0.012);
  builder.box("strip", {length, width, height}, at(x, y, floor + 0.5 * height, turn),
              sheet(rng, white(rng), length));
  const Color knob = rng.chance(0.6) ? from_hsv(0.0, 0.0, rng.uniform(0.2, 0.8)) : any_color(rng);
  const double radius = width * rng.uniform(0.1, 0.35);
  for (const double side : {-1.0, 1.0}) {
    const Affine there = at(x, y, floor + height, turn) *
                         Eigen::Translation3d(side * (0.5 * length - 0.6 * width), 0.0, 0.0);
    builder.disc("knob", radius, 0.002, there, coated(knob, rng.uniform(0.2, 0.9)));
  }
}

/// Things that lie about: cards, coins, pens, bottle tops, boxes.
void add_clutter(Rng& rng, Builder& builder, double x, double y, double floor) {
  const double turn = rng.uniform(0.0, 2.0 * diorama::kPi);
  const int kind = int(rng.index(5));
  const MaterialPtr material =
      rng.chance(0.4) ? print(rng, 0.09, 0.06) : coated(any_color(rng), rng.uniform(0.1, 0.9));
  if (kind == 0) {
    builder.box("card", {0.088, 0.063, 0.0006}, at(x, y, floor + 0.0003, turn), material);
  } else if (kind == 1) {
    auto metal = coated(from_hsv(rng.uniform(0.05, 0.14), 0.5 * rng.uniform(), 0.8), 0.35);
    metal->metallic = 1.0f;
    builder.disc("coin", rng.uniform(0.008, 0.0125), 0.002, at(x, y, floor + 0.001), metal);
  } else if (kind == 2) {
    const Affine lying =
        at(x, y, floor + 0.0045, turn) * Eigen::AngleAxisd(0.5 * diorama::kPi, Vec3::UnitX());
    builder.disc("pen", 0.0045, 0.14, lying, material);
  } else if (kind == 3) {
    builder.disc("top", rng.uniform(0.01, 0.03), 0.012, at(x, y, floor + 0.006), material);
  } else {
    const double height = rng.uniform(0.005, 0.03);
    builder.box("box", {rng.uniform(0.02, 0.12), rng.uniform(0.02, 0.12), height},
                at(x, y, floor + 0.5 * height, turn), material);
  }
}

/// Who takes the picture bends over the table: polished dice mirror a dark shape with light round
/// it.
void add_onlooker(Rng rng, Builder& builder) {
  const Vec3 size(rng.uniform(0.1, 0.35), rng.uniform(0.08, 0.3), 0.02);
  const Affine above = at(rng.uniform(-0.12, 0.12), rng.uniform(-0.12, 0.12),
                          rng.uniform(0.54, 0.8), rng.uniform(0.0, diorama::kPi));
  builder.box("onlooker", size, above, coated(from_hsv(0.0, 0.0, rng.uniform(0.05, 0.35)), 0.8));
}

void build_any(Rng rng, Builder& builder, double& half_x, double& half_y) {
  const bool has_tray = rng.chance(0.45);
  half_x = rng.uniform(0.11, 0.18);
  half_y = half_x * rng.uniform(0.65, 1.0);
  double floor = 0.0;
  if (has_tray) {
    const double thickness = rng.uniform(0.001, 0.004);
    floor = -thickness;
    const MaterialPtr bottom =
        rng.chance(0.65) ? sheet(rng, white(rng), 2.0 * half_x) : any_surface(rng, 2.0 * half_x);
    builder.box("bottom", {2.0 * half_x + 0.002, 2.0 * half_y + 0.002, thickness},
                at(0.0, 0.0, -0.5 * thickness), bottom);
    add_tray(rng, builder, half_x, half_y);
  } else if (rng.chance(0.25)) {
    builder.box("sheet",
                {2.0 * half_x * rng.uniform(1.0, 1.6), 2.0 * half_y * rng.uniform(1.0, 1.6), 0.001},
                at(0.0, 0.0, -0.0005, rng.uniform(0.0, diorama::kPi)),
                any_surface(rng, 2.0 * half_x));
    floor = -0.001;
  }
  builder.box("table", {kTable_m, kTable_m, 0.04}, at(0.0, 0.0, floor - 0.02),
              any_surface(rng, kTable_m));
  if (rng.chance(0.6)) add_onlooker(rng.fork("onlooker"), builder);
  const int strips = rng.chance(0.4) ? 1 + int(rng.index(2)) : 0;
  for (int i = 0; i < strips; ++i) {
    const double turn = 0.5 * diorama::kPi * double(rng.index(4));
    const double reach = std::max(half_x, half_y) + rng.uniform(0.03, 0.08);
    add_strip(rng, builder, reach * std::cos(turn), reach * std::sin(turn),
              turn + 0.5 * diorama::kPi, floor);
  }
  const int pieces = rng.chance(0.5) ? int(rng.index(9)) : 0;
  for (int i = 0; i < pieces; ++i) {
    const double turn = rng.uniform(0.0, 2.0 * diorama::kPi);
    const double reach = std::max(half_x, half_y) + rng.uniform(0.02, 0.12);
    add_clutter(rng, builder, reach * std::cos(turn), reach * std::sin(turn), floor);
  }
}

}  // namespace

void TableLoader::Params::visit(diorama::ParamVisitor& v) {
  static constexpr std::array<const char*, 2> kLooks{"any", "plain"};
  v.param("models", models, {"How many different tables there are.", "", 1, 1e6});
  v.param("first", first, {"Number of the first of them.", "", 0, 1e9});
  v.choice("look", look, kLooks, {"any: all there is; plain: a bare table of one colour."});
}

std::vector<std::string> TableLoader::assets() const {
  std::vector<std::string> names;
  const std::string scheme(params_.look == "any" ? kAny : kPlain);
  for (int i = 0; i < params_.models; ++i) {
    names.push_back(scheme + std::to_string(params_.first + i));
  }
  return names;
}

void TableLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  Rng rng = Rng(asset_number(asset)).fork("table");
  Builder builder(scene, root);
  double half_x = 0.14, half_y = 0.14;
  if (asset.starts_with(kPlain)) {
    const Color color = from_hsv(rng.uniform(), rng.uniform(), rng.uniform());
    builder.box("table", {kTable_m, kTable_m, 0.04}, at(0.0, 0.0, -0.02), coated(color, 0.7));
  } else {
    build_any(rng, builder, half_x, half_y);
  }
  // Dice that start here stay within, however they bounce.
  constexpr double kMargin_m = 0.02;
  Affine area = Affine::Identity();
  area.linear().diagonal() << half_x - kMargin_m, half_y - kMargin_m, 1.0;
  scene.set_pose(scene.create(root, "area"), area);
}

}  // namespace dice
