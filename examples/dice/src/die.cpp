// SPDX-License-Identifier: Apache-2.0
#include "die.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace dice {

using diorama::Mat3;
using diorama::Mesh;
using diorama::Rng;
using diorama::Vec2;
using diorama::Vec2f;
using diorama::Vec3;
using diorama::Vec3f;

namespace {

/// Faces are painted side by side, three in a row, each with a rim that takes the bleeding.
constexpr int kTile = 64;
constexpr int kRim = 4;
constexpr int kAtlasWidth = 3 * kTile;
constexpr int kAtlasHeight = 2 * kTile;
constexpr int kCells = 18;  ///< Squares along the edge of a face.

/// Signed distance, all but exact near the surface, in half edges; with a dome every face is a part
/// of a large ball.
double distance(const DieLook& look, const Vec3& p, double dome = 0.0) {
  const Vec3 bulge = 0.5 * dome * (Vec3::Constant(p.squaredNorm()) - p.cwiseAbs2());
  const Vec3 q = p.cwiseAbs() + bulge - Vec3::Constant(1.0 - look.rounding);
  const double box = q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0) - look.rounding;
  const double ball = p.norm() - look.ball;
  // The greater of both, with a small fillet between them.
  constexpr double kFillet = 0.06;
  const double h = std::max(kFillet - std::abs(box - ball), 0.0) / kFillet;
  return std::max(box, ball) + 0.25 * h * h * kFillet;
}

/// Polished faces are not quite flat, and mirror lamps that flat ones would miss. Light shows that,
/// outlines do not, so only normals know: dice rest on flat faces.
Vec3 shading_normal(const DieLook& look, const Vec3& p) {
  constexpr double kStep = 1e-4;
  Vec3 slope;
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 step = kStep * Vec3::Unit(axis);
    slope[axis] = distance(look, p + step, look.dome) - distance(look, p - step, look.dome);
  }
  return slope.normalized();
}

/// Where the ray from the centre leaves the die.
Vec3 surface_point(const DieLook& look, const Vec3& direction) {
  double inside = 0.0, outside = 1.8;
  for (int i = 0; i < 26; ++i) {
    const double middle = 0.5 * (inside + outside);
    (distance(look, middle * direction) < 0.0 ? inside : outside) = middle;
  }
  return 0.5 * (inside + outside) * direction;
}

/// Where a point of face `number` (in half edges) lies in the picture of all faces, in pixels from
/// its top left.
Vec2 atlas_point(int number, const Vec2& at) {
  const int column = (number - 1) % 3, row = (number - 1) / 3;
  const double half = 0.5 * kTile - kRim;
  return {(column + 0.5) * kTile + half * at.x(), (row + 0.5) * kTile - half * at.y()};
}

/// The other way round: the face and the place on it of a pixel.
std::pair<int, Vec2> face_point(double x, double y) {
  const int column = std::clamp(int(x / kTile), 0, 2), row = std::clamp(int(y / kTile), 0, 1);
  const double half = 0.5 * kTile - kRim;
  return {1 + row * 3 + column,
          {(x - (column + 0.5) * kTile) / half, ((row + 0.5) * kTile - y) / half}};
}

double pip_radius(const DieLook& look, int number) {
  return look.pip_radius * (number == 1 ? look.first_pip : 1.0);
}

Color body_color(const DieLook& look, const Vec3& at) {
  const double scale = look.pattern_scale;
  const Vec3 far = Vec3::Constant(11.3) + scale * at;
  switch (look.body) {
    case Body::Plain:
    case Body::Clear:
      return look.color;
    case Body::Marbled: {
      const Vec3 bent =
          far + 0.8 * Vec3(noise(look.seed + 10, far, 2), noise(look.seed + 20, far, 2),
                           noise(look.seed + 30, far, 2));
      const Color two =
          mix(look.color, look.second, smooth_step(-0.22, 0.22, noise(look.seed, bent, 3)));
      const double vein = 1.0 - std::abs(noise(look.seed + 40, 1.7 * bent, 2));
      return mix(two, look.third, 0.7 * smooth_step(0.86, 1.0, vein));
    }
    case Body::Speckled: {
      const NearestPoint grain = nearest_point(look.seed, 4.0 * far);
      const double size = 0.25 + 0.25 * double(grain.number % 97) / 97.0;
      const Color& spot = grain.number % 3 == 0 ? look.third : look.second;
      return mix(spot, look.color, smooth_step(size - 0.06, size + 0.06, grain.distance));
    }
    case Body::Striped:
      return mix(
          look.color, look.second,
          smooth_step(-0.15, 0.15, at.x() * 0.5 + at.z() * 0.3 + 0.5 * noise(look.seed, far, 2)));
  }
  return look.color;
}

/// 0 on the body, 1 in a pip.
double pip_share(const DieLook& look, int number, const Vec2& at, double softness) {
  double share = 0.0;
  for (const Vec2& place : pip_places(look, number)) {
    const double r = pip_radius(look, number);
    share = std::max(share, 1.0 - smooth_step(r - softness, r + softness, (at - place).norm()));
  }
  return share;
}

Color face_color(const DieLook& look, const std::array<Mat3, 6>& turns, int number,
                 const Vec2& at) {
  const Vec3 place = turns[std::size_t(number - 1)] * Vec3(at.x(), at.y(), 1.0);
  Color color = body_color(look, place);
  if (look.wear > 0.0) {
    const double edge = std::max(std::abs(at.x()), std::abs(at.y()));
    const double dirt = noise(look.seed + 70, 3.0 * place + Vec3::Constant(5.0), 3);
    color = mix(color, Color(0.35f, 0.3f, 0.25f), 0.35 * look.wear * smooth_step(0.0, 0.5, dirt));
    color = mix(color, mix(color, Color::Ones(), 0.5),
                look.wear * smooth_step(0.75, 1.0, edge + 0.2 * dirt));
  }
  double share = pip_share(look, number, at, 0.012);
  if (look.wear > 0.0) {
    const double chip = noise(look.seed + 90, 5.0 * place, 3);
    share *= 1.0 - 0.5 * smooth_step(0.1, 0.3, chip + look.wear - 0.7);
  }
  return mix(color, number == 1 ? look.one : look.pips, share);
}

/// Tangent-space normals, 0..1 for -1..1: pips are hollow like parts of balls.
std::shared_ptr<const diorama::Texture> dents(const DieLook& look) {
  const auto slope = [&](double x, double y) {
    const auto [number, at] = face_point(x, y);
    Vec3f normal(0.0f, 0.0f, 1.0f);
    for (const Vec2& place : pip_places(look, number)) {
      const double r = pip_radius(look, number);
      const Vec2 inside = at - place;
      if (inside.norm() > r) continue;
      const Vec2 tilt = -look.dent / r * inside;
      normal = Vec3f(float(tilt.x()), float(tilt.y()), 1.0f).normalized();
    }
    return Color(0.5f * normal + Vec3f::Constant(0.5f));
  };
  auto texture =
      std::make_shared<diorama::Texture>(*painted("die normals", kAtlasWidth, kAtlasHeight, slope));
  texture->color_space = diorama::ColorSpace::Linear;
  return texture;
}

/// How far apart two paints look: light against dark tells most.
double contrast(const Color& a, const Color& b) {
  const auto lightness = [](const Color& c) {
    return 0.3 * double(c.x()) + 0.59 * double(c.y()) + 0.11 * double(c.z());
  };
  const double light = lightness(a) - lightness(b);
  return std::sqrt(light * light + 0.6 * double((a - b).squaredNorm()));
}

/// Paint for pips, as common as it is sold.
Color any_paint(Rng& rng) {
  const double kind = rng.uniform();
  const double shade = rng.uniform();
  if (kind < 0.42) return from_hsv(0.13, 0.1 * shade, 0.85 + 0.15 * shade);
  if (kind < 0.64) return from_hsv(0.6, 0.3 * shade, 0.03 + 0.1 * shade);
  if (kind < 0.76)
    return from_hsv(0.1 + 0.06 * shade, 0.6 + 0.35 * shade, 0.75 + 0.2 * shade);  // yellow, gold
  if (kind < 0.94) return from_hsv(0.98, 0.7 + 0.3 * shade, 0.5 + 0.45 * shade);
  return from_hsv(shade, 0.7, 0.9);
}

/// Paint for pips that can be told from all colours of a body: on some dice at a glance, on others
/// (dark red on black) just so.
Color pip_color(Rng& rng, const DieLook& look) {
  const double wanted = rng.chance(0.3) ? rng.uniform(0.27, 0.5) : rng.uniform(0.5, 0.8);
  const bool is_one_color = look.body == Body::Plain || look.body == Body::Clear;
  Color best = Color::Ones();
  double best_contrast = -1.0;
  for (int i = 0; i < 20; ++i) {
    const Color color = any_paint(rng);
    double found = contrast(color, look.color);
    if (!is_one_color) {
      found = std::min({found, contrast(color, look.second), contrast(color, look.third)});
    }
    if (found > wanted) return color;
    if (found > best_contrast) {
      best = color;
      best_contrast = found;
    }
  }
  return best;
}

/// Red pips on a dark body: told from it by their hue alone. Detectors learn them last, so there
/// are more of them than in shops.
void make_red_on_dark(Rng& rng, DieLook& look) {
  const bool is_grey = rng.chance(0.6);
  const double hue = rng.uniform();
  const double a = rng.uniform();
  const double b = rng.uniform();
  look.color = is_grey ? from_hsv(hue, 0.35 * a, 0.08 + 0.24 * b)
                       : from_hsv(0.54 + 0.26 * hue, 0.6 + 0.4 * a, 0.25 + 0.5 * b);
  look.second = mix(look.color, Color::Zero(), rng.uniform(0.3, 0.95));
  look.third = mix(look.color, Color::Ones(), rng.uniform(0.0, 0.25));
  if (look.body == Body::Clear) look.body = Body::Marbled;
  const double red = rng.uniform(0.92, 1.0);
  const double depth = rng.uniform(0.65, 1.0);
  look.pips = from_hsv(red, depth, rng.uniform(0.45, 0.85));
  look.one = look.pips;
}

DieLook any_shape(Rng& rng) {
  DieLook look;
  look.seed = rng.bits();
  const double size = rng.uniform();
  const double any_size = rng.uniform();
  look.edge_m = size < 0.35   ? 0.0115 + 0.001 * any_size
                : size < 0.75 ? 0.0155 + 0.001 * any_size
                              : 0.010 + 0.010 * any_size;
  look.rounding = rng.uniform(0.08, 0.34);
  look.ball = rng.chance(0.4) ? rng.uniform(1.28, 1.5) : 2.0;
  look.dome = rng.chance(0.8) ? rng.uniform(0.02, 0.3) : 0.0;
  look.is_mirrored = rng.chance(0.5);
  for (bool& turned : look.is_turned) turned = rng.chance(0.5);
  look.pip_offset = rng.uniform(0.44, 0.58);
  look.pip_radius = std::min(rng.uniform(0.16, 0.27), 0.45 * look.pip_offset);
  look.dent = rng.chance(0.2) ? 0.0 : rng.uniform(0.2, 0.9);
  look.first_pip = rng.chance(0.06) ? rng.uniform(1.2, 1.6) : 1.0;
  return look;
}

}  // namespace

std::array<Mat3, 6> faces(bool is_mirrored) {
  // 1 up, 2 in front, 3 to the right or to the left; opposite faces add up to seven.
  const Vec3 right = is_mirrored ? Vec3(-Vec3::UnitX()) : Vec3(Vec3::UnitX());
  const std::array<Vec3, 6> normals{Vec3::UnitZ(), -Vec3::UnitY(), right,
                                    -right,        Vec3::UnitY(),  -Vec3::UnitZ()};
  std::array<Mat3, 6> turns;
  for (std::size_t i = 0; i < 6; ++i) {
    const Vec3& z = normals[i];
    const Vec3 y = std::abs(z.z()) > 0.5 ? Vec3(Vec3::UnitY()) : Vec3(Vec3::UnitZ());
    turns[i] << y.cross(z), y, z;
  }
  return turns;
}

std::vector<Vec2> pip_places(const DieLook& look, int number) {
  const double s = look.pip_offset;
  std::vector<Vec2> places;
  if (number % 2 == 1) places.emplace_back(0.0, 0.0);
  const bool is_turned = number < 4 ? look.is_turned[number == 2 ? 0 : 1] : false;
  if (number == 2 || number == 3) {
    const double x = is_turned ? -s : s;
    places.insert(places.end(), {Vec2(x, s), Vec2(-x, -s)});
  }
  if (number >= 4)
    places.insert(places.end(), {Vec2(s, s), Vec2(-s, -s), Vec2(s, -s), Vec2(-s, s)});
  if (number == 6) {
    const Vec2 middle = look.is_turned[2] ? Vec2(0.0, s) : Vec2(s, 0.0);
    places.insert(places.end(), {middle, -middle});
  }
  return places;
}

DieLook any_look(Rng rng) {
  DieLook look = any_shape(rng);
  const double kind = rng.uniform();
  look.body = kind < 0.46   ? Body::Plain
              : kind < 0.90 ? Body::Marbled
              : kind < 0.93 ? Body::Speckled
              : kind < 0.97 ? Body::Striped
                            : Body::Clear;
  look.color = any_color(rng);
  // Pearl is one colour in two depths as often as two colours; veins are a little lighter or
  // darker.
  look.second = rng.chance(0.6) ? mix(look.color, Color::Zero(), rng.uniform(0.2, 0.8))
                                : mix(look.color, any_color(rng), rng.uniform(0.4, 1.0));
  look.third = mix(look.color, any_color(rng), rng.uniform(0.1, 0.6));
  look.pips = pip_color(rng, look);
  look.one = rng.chance(0.08) ? Color(0.75f, 0.05f, 0.05f) : look.pips;
  if (contrast(look.one, look.color) < 0.5) look.one = look.pips;
  look.pattern_scale = rng.uniform(0.4, 1.6);
  look.wear = rng.chance(0.08) ? rng.uniform(0.2, 0.6) : 0.0;
  look.roughness = rng.chance(0.6) ? rng.uniform(0.03, 0.15) : rng.uniform(0.15, 0.4);
  look.clearcoat = rng.chance(0.6) ? rng.uniform(0.3, 1.0) : 0.0;
  if (rng.chance(0.16)) make_red_on_dark(rng, look);
  if (look.body == Body::Clear) look.transmission = rng.uniform(0.15, 0.4);
  return look;
}

DieLook plain_look(Rng rng) {
  DieLook look = any_shape(rng);
  look.color = from_hsv(rng.uniform(), rng.uniform(), rng.uniform());
  look.pips = look.one = look.color.mean() > 0.5f ? Color::Zero() : Color::Ones();
  look.roughness = 0.5;
  return look;
}

std::shared_ptr<const Mesh> die_mesh(const DieLook& look) {
  auto mesh = std::make_shared<Mesh>();
  const std::array<Mat3, 6> turns = faces(look.is_mirrored);
  const double half_m = 0.5 * look.edge_m;
  for (int number = 1; number <= 6; ++number) {
    const Mat3& turn = turns[std::size_t(number - 1)];
    const auto first = std::uint32_t(mesh->positions.size());
    for (int row = 0; row <= kCells; ++row) {
      for (int column = 0; column <= kCells; ++column) {
        // Closer together towards the edges, where the surface bends.
        const auto along = [](int i) {
          constexpr double kReach = 0.4 * diorama::kPi;
          return std::sin(kReach * (2.0 * i / kCells - 1.0)) / std::sin(kReach);
        };
        const Vec3 p =
            surface_point(look, (turn * Vec3(along(column), along(row), 1.0)).normalized());
        const Vec3 on_face = turn.transpose() * p;
        const Vec2 pixel = atlas_point(number, on_face.head<2>());
        mesh->positions.push_back((half_m * p).cast<float>());
        mesh->normals.push_back(shading_normal(look, p).cast<float>());
        mesh->uvs.emplace_back(float(pixel.x() / kAtlasWidth),
                               float(1.0 - pixel.y() / kAtlasHeight));
      }
    }
    for (int row = 0; row < kCells; ++row) {
      for (int column = 0; column < kCells; ++column) {
        const std::uint32_t a = first + std::uint32_t(row * (kCells + 1) + column);
        const std::uint32_t b = a + 1, c = a + kCells + 2, d = a + kCells + 1;
        mesh->triangles.push_back({a, b, c});
        mesh->triangles.push_back({a, c, d});
      }
    }
  }
  return mesh;
}

std::shared_ptr<const diorama::Material> die_material(const DieLook& look) {
  const std::array<Mat3, 6> turns = faces(look.is_mirrored);
  auto material = std::make_shared<diorama::Material>();
  material->name = "die";
  material->base_color = Vec3f::Ones();
  material->base_color_texture.texture =
      painted("die", kAtlasWidth, kAtlasHeight, [&](double x, double y) {
        const auto [number, at] = face_point(x, y);
        return face_color(look, turns, number, at);
      });
  if (look.dent > 0.0) {
    material->normal_texture.texture = dents(look);
    material->normal_texture.scale = {2, 2, 2, 1};
    material->normal_texture.bias = {-1, -1, -1, 0};
  }
  material->roughness = float(look.roughness);
  material->clearcoat = float(look.clearcoat);
  material->transmission = float(look.transmission);
  return material;
}

}  // namespace dice
