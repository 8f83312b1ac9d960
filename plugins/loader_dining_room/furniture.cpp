// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/furniture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "modelling/shapes.h"

namespace diorama::dining_room {

using namespace modelling;

namespace {

/// Adds boxes given by corners, each with its own cut of the texture.
class Joiner {
 public:
  Joiner(MeshBuilder& builder, const Finish& finish_of, std::uint16_t slot, Rng rng,
         const Affine& pose = Affine::Identity())
      : builder_(builder), finish_(finish_of), slot_(slot), rng_(rng), pose_(pose) {}

  void board(const Vec3& low, const Vec3& high, double bevel = 0.003) {
    const Vec3 size = high - low;
    int longest = 0;
    size.maxCoeff(&longest);
    start(at((low + high) / 2));
    add_box(builder_, size, bevel, Axis(longest));
  }
  void start(const Affine& pose) {
    builder_.begin(pose_ * pose,
                   {slot_, finish_.repeats_per_m, Vec2(rng_.uniform(), rng_.uniform())});
  }
  MeshBuilder& builder() { return builder_; }

 private:
  MeshBuilder& builder_;
  Finish finish_;
  std::uint16_t slot_;
  Rng rng_;
  Affine pose_;
};

/// A straight leg from `foot` to `head`, rectangular or round section, thinner at the foot.
void add_leg(Joiner& joiner, const Vec3& foot_centre, const Vec3& head, double at_foot,
             double at_head, bool is_round) {
  joiner.start(Affine::Identity());
  // A leg that leans stands on the edge of its foot.
  constexpr double kRounding = 0.003;
  const Vec3 lean = (head - foot_centre).normalized();
  const bool is_on_floor = foot_centre.z() == 0;
  const double dip = is_on_floor ? (at_foot / 2 - kRounding) * lean.head<2>().norm() : 0.0;
  const Vec3 foot = foot_centre + Vec3(0, 0, dip);
  std::vector<PathPoint> path;
  for (int i = 0; i <= 4; ++i) {
    const double t = i / 4.0;
    const double half = std::lerp(at_foot, at_head, t) / 2;
    path.push_back({foot + t * (head - foot), half, half});
  }
  // The ends are rounded a little.
  path.insert(path.begin() + 1, path.front());
  path[1].place += (head - foot).normalized() * kRounding;
  path[0].radius_x = path[0].radius_y = path[0].radius_x - kRounding;
  add_sweep(joiner.builder(), path, is_round ? 20 : 28, Vec3::UnitY(), is_round ? 2.0 : 9.0);
}

/// A turned leg on z = 0.
void add_turned_leg(Joiner& joiner, const Vec2& place, double height, double width, int variant) {
  const double r = width / 2;
  const std::array<std::array<double, 10>, 2> swell{
      {{0.45, 0.62, 0.5, 0.55, 0.8, 0.98, 0.72, 0.52, 0.85, 0.6},
       {0.40, 0.50, 0.42, 0.48, 0.58, 0.70, 0.82, 0.92, 0.60, 0.95}}};
  const double turned = height - 0.16;
  std::vector<ProfilePoint> profile{{0, 0}, {0.35 * r, 0}};
  const auto& radii = swell[std::size_t(variant)];
  constexpr int kSteps = 36;
  for (int i = 0; i <= kSteps; ++i) {
    const double t = double(i) / kSteps;
    const double x = t * 9;
    const auto k = std::min<std::size_t>(8, std::size_t(x));
    const double f = x - double(k);
    const double s = f * f * (3 - 2 * f);
    profile.push_back({r * std::lerp(radii[k], radii[k + 1], s), 0.012 + (turned - 0.012) * t});
  }
  profile.push_back({0, turned});
  joiner.start(at(place.x(), place.y(), 0));
  add_lathe(joiner.builder(), profile, 28, 0.8);
  joiner.board({place.x() - r, place.y() - r, turned - 0.002},
               {place.x() + r, place.y() + r, height});
}

void add_table_top(Joiner& wood, const RoomPlan& plan, double thickness, Rng rng) {
  const double l = plan.table_length, w = plan.table_width, h = plan.table_height;
  if (plan.table_shape == TableShape::Round) {
    wood.start(at(0, 0, h - thickness));
    std::vector<Vec2> outline;
    for (int i = 0; i < 96; ++i) {
      outline.emplace_back(l / 2 * std::cos(2 * kPi * i / 96), l / 2 * std::sin(2 * kPi * i / 96));
    }
    add_prism(wood.builder(), outline, thickness, 0.007);
    return;
  }
  if (rng.chance(0.5)) {
    wood.start(at(0, 0, h - thickness));
    add_prism(wood.builder(), rounded_rectangle(l, w, rng.uniform(0.012, 0.09), 8), thickness,
              0.006);
    return;
  }
  // Boards side by side, cross boards at the ends.
  const int boards = 5 + int(rng.index(3));
  const double end = rng.chance(0.6) ? 0.09 : 0.0;
  const double pitch = w / boards;
  for (int i = 0; i < boards; ++i) {
    wood.board({-l / 2 + end, -w / 2 + i * pitch, h - thickness},
               {l / 2 - end, -w / 2 + (i + 1) * pitch, h}, 0.0025);
  }
  if (end == 0.0) return;
  wood.board({-l / 2, -w / 2, h - thickness}, {-l / 2 + end, w / 2, h}, 0.0025);
  wood.board({l / 2 - end, -w / 2, h - thickness}, {l / 2, w / 2, h}, 0.0025);
}

void add_apron(Joiner& wood, double l, double w, double top, double height) {
  constexpr double kThick = 0.022;
  for (const double s : {-1.0, 1.0}) {
    const double y = s * w / 2, x = s * l / 2;
    wood.board({-l / 2, std::min(y, y - s * kThick), top - height},
               {l / 2, std::max(y, y - s * kThick), top});
    wood.board({std::min(x, x - s * kThick), -w / 2 + kThick, top - height},
               {std::max(x, x - s * kThick), w / 2 - kThick, top});
  }
}

void add_corner_legs(Joiner& legs, double l, double w, double top, double width, int kind) {
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const Vec2 p(sx * (l / 2 - width / 2), sy * (w / 2 - width / 2));
      if (kind == 0) {
        add_leg(legs, Vec3(p.x(), p.y(), 0), Vec3(p.x(), p.y(), top), width, width, false);
      } else if (kind == 1) {
        add_leg(legs, Vec3(p.x() + sx * 0.02, p.y() + sy * 0.02, 0), Vec3(p.x(), p.y(), top),
                width * 0.5, width, false);
      } else {
        add_turned_leg(legs, p, top, width * 1.15, kind - 2);
      }
    }
  }
}

void add_pedestal(Joiner& wood, double top, double reach, int feet, double start) {
  const std::array<ProfilePoint, 11> column{{{0, 0.10},
                                             {0.075, 0.10},
                                             {0.085, 0.16},
                                             {0.062, 0.22},
                                             {0.050, 0.32},
                                             {0.056, 0.42},
                                             {0.072, 0.52},
                                             {0.05, 0.58},
                                             {0.10, top - 0.05},
                                             {0.16, top},
                                             {0, top}}};
  wood.start(Affine::Identity());
  add_lathe(wood.builder(), column, 40, 0.75);
  for (int i = 0; i < feet; ++i) {
    const double angle = start + 2 * kPi * i / feet;
    const Vec3 out(std::cos(angle), std::sin(angle), 0);
    const std::array<Vec3, 4> knots{out * 0.04 + Vec3(0, 0, 0.20), out * 0.16 + Vec3(0, 0, 0.17),
                                    out * 0.32 + Vec3(0, 0, 0.075),
                                    out * reach + Vec3(0, 0, 0.028)};
    std::vector<PathPoint> path;
    const std::vector<Vec3> curve = smooth_path(knots, 6);
    for (std::size_t k = 0; k < curve.size(); ++k) {
      const double t = double(k) / double(curve.size() - 1);
      path.push_back({curve[k], std::lerp(0.030, 0.022, t), std::lerp(0.042, 0.0265, t)});
    }
    wood.start(Affine::Identity());
    add_sweep(wood.builder(), path, 24, Vec3::UnitZ(), 5.0);
  }
}

void add_trestle(Joiner& wood, double l, double w, double top) {
  for (const double s : {-1.0, 1.0}) {
    const double x = s * (l / 2 - 0.32);
    wood.board({x - 0.05, -w / 2 + 0.12, 0}, {x + 0.05, w / 2 - 0.12, 0.07}, 0.012);
    wood.board({x - 0.045, -w / 2 + 0.10, top - 0.06}, {x + 0.045, w / 2 - 0.10, top}, 0.006);
    wood.board({x - 0.035, -0.17, 0.07}, {x + 0.035, -0.06, top - 0.06}, 0.006);
    wood.board({x - 0.035, 0.06, 0.07}, {x + 0.035, 0.17, top - 0.06}, 0.006);
  }
  wood.board({-l / 2 + 0.285, -0.035, 0.26}, {l / 2 - 0.285, 0.035, 0.34}, 0.006);
}

void add_metal_frames(Joiner& metal, double l, double w, double top) {
  constexpr double kBar = 0.05;
  for (const double s : {-1.0, 1.0}) {
    const double x = s * (l / 2 - 0.22);
    const double y = w / 2 - 0.08;
    metal.board({x - kBar / 2, -y, 0}, {x + kBar / 2, y, 0.02}, 0.003);
    metal.board({x - kBar / 2, -y, top - 0.02}, {x + kBar / 2, y, top}, 0.003);
    metal.board({x - kBar / 2, -y, 0.02}, {x + kBar / 2, -y + 0.03, top - 0.02}, 0.003);
    metal.board({x - kBar / 2, y - 0.03, 0.02}, {x + kBar / 2, y, top - 0.02}, 0.003);
  }
  metal.board({-l / 2 + 0.245, -0.02, top - 0.04}, {l / 2 - 0.245, 0.02, top}, 0.003);
}

/// Half sizes of a chair.
constexpr double kSeatHalfWidth = 0.22;
constexpr double kSeatHalf = kSeatDepth / 2;

struct ChairStyle {
  int kind = 0;  ///< 0 slats, 1 rungs, 2 upholstered, 3 spindles, 4 shell
  double seat = 0.45;
  double back = 0.92;
  bool is_round = false;
};

/// Four legs, rails between them and posts that lean back: the frame of joined chairs.
void add_chair_frame(Joiner& wood, const ChairStyle& style, bool has_stretchers) {
  const double front_y = kSeatHalf - 0.03, back_y = -kSeatHalf + 0.025;
  const double x = kSeatHalfWidth - 0.025;
  const double rail_top = style.seat - 0.022, rail_low = rail_top - 0.06;
  for (const double s : {-1.0, 1.0}) {
    add_leg(wood, Vec3(s * x, front_y, 0), Vec3(s * x, front_y, rail_top), 0.028, 0.040,
            style.is_round);
    // The back leg runs on as post, bent at the seat.
    std::vector<PathPoint> post;
    const std::array<Vec3, 4> knots{Vec3(s * (x - 0.01), back_y - 0.03, 0),
                                    Vec3(s * (x - 0.01), back_y, style.seat * 0.6),
                                    Vec3(s * (x - 0.01), back_y - 0.005, style.seat + 0.06),
                                    Vec3(s * (x - 0.01), back_y - 0.075, style.back)};
    for (const Vec3& p : smooth_path(knots, 6)) {
      const double half = 0.0125 + 0.005 * std::exp(-10 * std::pow(p.z() - style.seat, 2.0));
      post.push_back({p, half, half});
    }
    wood.start(Affine::Identity());
    add_sweep(wood.builder(), post, style.is_round ? 16 : 24, Vec3::UnitY(),
              style.is_round ? 2.0 : 8.0);
    wood.board({s * x - 0.010, back_y, rail_low}, {s * x + 0.010, front_y, rail_top}, 0.002);
    if (has_stretchers) {
      wood.board({s * x - 0.008, back_y - 0.01, 0.18}, {s * x + 0.008, front_y, 0.205}, 0.004);
    }
  }
  wood.board({-x, front_y - 0.010, rail_low}, {x, front_y + 0.010, rail_top}, 0.002);
  wood.board({-x, back_y - 0.010, rail_low}, {x, back_y + 0.010, rail_top}, 0.002);
  if (has_stretchers) wood.board({-x, -0.012, 0.182}, {x, 0.012, 0.203}, 0.004);
}

/// Where the middle of the back is at a height.
double back_line(const ChairStyle& style, double z) {
  const double t = (z - style.seat - 0.06) / (style.back - style.seat - 0.06);
  return -kSeatHalf + 0.02 - 0.075 * std::clamp(t, 0.0, 1.0);
}

/// A board across the back, bent backwards in the middle.
void add_back_rail(Joiner& wood, const ChairStyle& style, double z_low, double z_high,
                   double half) {
  wood.start(Affine::Identity());
  const auto surface = [&](double u, double v) {
    const double x = std::lerp(half, -half, u);
    const double z = std::lerp(z_low, z_high, v);
    const double bend = 0.022 * (1 - std::pow(x / half, 2.0));
    const double crest = 0.012 * (1 - std::pow(x / half, 2.0)) * v;
    return Vec3(x, back_line(style, z) - bend, z + crest);
  };
  add_sheet(wood.builder(), 16, 4, 0.016, surface, Vec2(2 * half, z_high - z_low));
}

void add_wooden_seat(Joiner& wood, const ChairStyle& style) {
  wood.start(at(0, 0.005, style.seat - 0.022));
  add_prism(wood.builder(),
            rounded_rectangle(2 * kSeatHalfWidth + 0.01, kSeatDepth - 0.03, 0.03, 6), 0.022, 0.007);
}

void add_cushion(MeshBuilder& builder, const RoomMaterials& m, const Vec3& centre, const Vec3& size,
                 const Affine& turn, std::uint16_t slot) {
  builder.begin(at(centre) * turn, {slot, m.seat_fabric.repeats_per_m});
  add_box(builder, size, 0.45 * size.minCoeff(), Axis::X, 5);
}

void add_spindle_chair(Joiner& wood, const ChairStyle& style) {
  wood.start(at(0, 0, style.seat - 0.035));
  add_prism(wood.builder(),
            rounded_rectangle(2 * kSeatHalfWidth + 0.01, kSeatDepth - 0.01, 0.12, 10), 0.035,
            0.012);
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      add_leg(wood, Vec3(sx * 0.215, sy * 0.20, 0), Vec3(sx * 0.15, sy * 0.14, style.seat - 0.02),
              0.026, 0.036, true);
    }
    const double t = 0.4;
    add_leg(wood, Vec3(sx * std::lerp(0.215, 0.15, t), -std::lerp(0.20, 0.14, t), style.seat * t),
            Vec3(sx * std::lerp(0.215, 0.15, t), std::lerp(0.20, 0.14, t), style.seat * t), 0.018,
            0.018, true);
  }
  add_leg(wood, Vec3(-std::lerp(0.215, 0.15, 0.4), 0, style.seat * 0.4),
          Vec3(std::lerp(0.215, 0.15, 0.4), 0, style.seat * 0.4), 0.018, 0.018, true);
  for (int i = -3; i <= 3; ++i) {
    const double x = i * 0.052;
    const double bend = 0.022 * (1 - std::pow(x / 0.21, 2.0));
    add_leg(wood, Vec3(x * 0.92, -kSeatHalf + 0.045, style.seat - 0.005),
            Vec3(x * 1.18, back_line(style, style.back - 0.06) - bend, style.back - 0.05), 0.013,
            0.010, true);
  }
  add_back_rail(wood, style, style.back - 0.07, style.back, 0.225);
}

void add_shell_chair(MeshBuilder& builder, Joiner& wood, const ChairStyle& style) {
  // One moulded surface from the front edge of the seat up the back, thickened.
  builder.begin(Affine::Identity(), {2, 1.0});
  const std::array<Vec3, 7> spine{Vec3(0, kSeatHalf, style.seat - 0.035),
                                  Vec3(0, kSeatHalf - 0.06, style.seat),
                                  Vec3(0, 0.0, style.seat - 0.018),
                                  Vec3(0, -kSeatHalf + 0.07, style.seat + 0.005),
                                  Vec3(0, -kSeatHalf + 0.005, style.seat + 0.09),
                                  Vec3(0, -kSeatHalf - 0.045, style.seat + 0.24),
                                  Vec3(0, -kSeatHalf - 0.075, style.back - 0.08)};
  const std::vector<Vec3> line = smooth_path(spine, 8);
  const auto surface = [&](double u, double v) {
    const double k = v * double(line.size() - 1);
    const auto i = std::min(line.size() - 2, std::size_t(k));
    const Vec3 mid = line[i] + (k - double(i)) * (line[i + 1] - line[i]);
    const double x = 2 * u - 1;
    // Narrower and rounder towards both ends.
    const double half =
        0.23 * std::pow(std::max(1e-3, 1 - std::pow(std::abs(2 * v - 1), 5.0) * 0.72), 0.5);
    const double lift = 0.05 * x * x * std::sin(kPi * std::min(1.0, v * 1.1));
    const double t = std::clamp((v - 0.45) / 0.25, 0.0, 1.0);
    const double at_back = t * t * (3 - 2 * t);
    return Vec3(-x * half, mid.y() + 0.7 * lift * at_back, mid.z() + 0.7 * lift * (1 - at_back));
  };
  add_sheet(
      builder, 20, 40, 0.009, [&](double u, double v) { return surface(1 - u, v); },
      Vec2(0.46, 0.9));
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      add_leg(wood, Vec3(sx * 0.21, sy * 0.19, 0), Vec3(sx * 0.10, sy * 0.08, style.seat - 0.03),
              0.022, 0.032, true);
    }
  }
  wood.board({-0.13, -0.11, style.seat - 0.045}, {0.13, 0.11, style.seat - 0.026}, 0.006);
}

/// A cabinet door or drawer front with a frame, at y = 0 looking along -y.
void add_front(Joiner& wood, double x0, double z0, double x1, double z1, bool is_framed) {
  constexpr double kThick = 0.018, kFrame = 0.055;
  const double y0 = -kThick;
  if (!is_framed || x1 - x0 < 0.18 || z1 - z0 < 0.18) {
    wood.board({x0, y0, z0}, {x1, 0, z1}, 0.0025);
    return;
  }
  wood.board({x0, y0, z0}, {x0 + kFrame, 0, z1}, 0.0025);
  wood.board({x1 - kFrame, y0, z0}, {x1, 0, z1}, 0.0025);
  wood.board({x0 + kFrame, y0, z0}, {x1 - kFrame, 0, z0 + kFrame}, 0.0025);
  wood.board({x0 + kFrame, y0, z1 - kFrame}, {x1 - kFrame, 0, z1}, 0.0025);
  wood.board({x0 + kFrame, y0 + 0.009, z0 + kFrame}, {x1 - kFrame, 0, z1 - kFrame}, 0.001);
}

void add_pull(MeshBuilder& builder, const Vec3& place, bool is_knob, bool is_level) {
  if (is_knob) {
    builder.begin(at(place) * turned_x(kPi / 2), {1, 1.0});
    const std::array<ProfilePoint, 8> knob{{{0, 0},
                                            {0.007, 0},
                                            {0.006, 0.010},
                                            {0.011, 0.014},
                                            {0.0145, 0.020},
                                            {0.012, 0.026},
                                            {0.006, 0.0285},
                                            {0, 0.029}}};
    add_lathe(builder, knob, 24, 0.9);
    return;
  }
  builder.begin(at(place) * (is_level ? Affine::Identity() : turned_y(kPi / 2)), {1, 1.0});
  const std::array<Vec3, 7> bow{
      Vec3(-0.060, 0, 0),     Vec3(-0.055, -0.016, 0), Vec3(-0.038, -0.027, 0), Vec3(0, -0.031, 0),
      Vec3(0.038, -0.027, 0), Vec3(0.055, -0.016, 0),  Vec3(0.060, 0, 0)};
  add_tube(builder, smooth_path(bow, 5), 0.0045, 12);
}

}  // namespace

Piece build_table(const RoomPlan& plan, const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  Joiner wood(builder, m.table_wood, 0, rng.fork("grain"));
  const double thickness = rng.uniform(0.028, 0.048);
  const double top = plan.table_height - thickness;
  add_table_top(wood, plan, thickness, rng.fork("top"));
  const bool is_metal = rng.chance(0.25);
  Joiner legs(builder, is_metal ? m.leg_metal : m.table_wood, is_metal ? 1 : 0, rng.fork("legs"));
  const double l = plan.table_length, w = plan.table_width;
  if (plan.table_shape == TableShape::Round) {
    add_pedestal(wood, top, 0.36 * l, 4, rng.uniform(0, kPi));
    return finish(builder, {m.table_wood.material, m.leg_metal.material});
  }
  const double kind = rng.uniform();
  if (is_metal && plan.table_shape == TableShape::Rectangle) {
    add_metal_frames(legs, l, w, top);
  } else if (kind < 0.18 && plan.table_shape == TableShape::Rectangle) {
    add_trestle(wood, l, w, top);
  } else {
    constexpr double kInset = 0.035;
    const double width = rng.uniform(0.062, 0.085);
    const double apron = rng.uniform(0.07, 0.095);
    add_apron(wood, l - 2 * kInset - 0.02, w - 2 * kInset - 0.02, top, apron);
    add_corner_legs(legs, l - 2 * kInset, w - 2 * kInset, top, width,
                    is_metal ? 0 : int(rng.index(4)));
  }
  return finish(builder, {m.table_wood.material, m.leg_metal.material});
}

Piece build_chair(double table_height, const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  ChairStyle style;
  style.kind = int(rng.index(5));
  style.seat = std::clamp(table_height - 0.29, 0.41, 0.47);
  style.back = style.seat + rng.uniform(0.42, 0.55);
  style.is_round = rng.chance(0.4);
  Joiner wood(builder, m.table_wood, 0, rng.fork("grain"));
  switch (style.kind) {
    case 0:
      add_chair_frame(wood, style, rng.chance(0.6));
      add_wooden_seat(wood, style);
      add_back_rail(wood, style, style.back - 0.085, style.back - 0.012, 0.20);
      add_back_rail(wood, style, style.seat + 0.10, style.seat + 0.14, 0.20);
      for (int i = -2; i <= 2; ++i) {
        const double x = i * 0.068;
        const double bend = 0.022 * (1 - std::pow(x / 0.2, 2.0));
        wood.start(Affine::Identity());
        const auto slat = [&](double u, double v) {
          const double z = std::lerp(style.seat + 0.13, style.back - 0.07, v);
          return Vec3(x + std::lerp(0.016, -0.016, u), back_line(style, z) - bend, z);
        };
        add_sheet(builder, 2, 8, 0.008, slat, Vec2(0.03, 0.4));
      }
      break;
    case 1: {
      add_chair_frame(wood, style, true);
      add_wooden_seat(wood, style);
      const int rungs = 3 + int(rng.index(2));
      for (int i = 0; i < rungs; ++i) {
        const double z = std::lerp(style.seat + 0.12, style.back - 0.07, double(i) / (rungs - 1));
        add_back_rail(wood, style, z, z + 0.05, 0.20);
      }
      break;
    }
    case 2: {
      add_chair_frame(wood, style, false);
      add_cushion(builder, m, {0, 0.005, style.seat - 0.005}, {0.45, kSeatDepth - 0.01, 0.07},
                  Affine::Identity(), 1);
      const double middle = (style.seat + 0.10 + style.back) / 2;
      add_cushion(builder, m, {0, back_line(style, middle) + 0.005, middle},
                  {0.42, 0.055, style.back - style.seat - 0.06}, turned_x(0.17), 1);
      break;
    }
    case 3:
      add_spindle_chair(wood, style);
      break;
    default:
      add_shell_chair(builder, wood, style);
      break;
  }
  return finish(builder, {m.table_wood.material, m.seat_fabric.material, m.shell.material});
}

Cabinet build_sideboard(double width, const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  Joiner wood(builder, m.cabinet_wood, 0, rng.fork("grain"));
  Joiner counter(builder, m.counter, 2, rng.fork("counter"));
  const double height = rng.uniform(0.76, 0.90);
  constexpr double kTop = 0.026, kFront = 0.02;
  const double foot = rng.uniform(0.07, 0.17);
  const double x0 = -width / 2, x1 = width / 2, y0 = -kSideboardDepth + kFront;
  counter.board({x0, -kSideboardDepth, height - kTop}, {x1, 0, height}, 0.004);
  wood.board({x0 + 0.008, y0, foot}, {x1 - 0.008, -0.004, height - kTop}, 0.003);
  if (foot < 0.11) {
    wood.board({x0 + 0.03, y0 + 0.04, 0}, {x1 - 0.03, -0.03, foot}, 0.002);
  } else {
    for (const double s : {-1.0, 1.0}) {
      for (const double y : {y0 + 0.05, -0.06}) {
        add_leg(wood, Vec3(s * (width / 2 - 0.05), y, 0),
                Vec3(s * (width / 2 - 0.07), y, foot + 0.005), 0.022, 0.04, true);
      }
    }
  }
  const bool is_framed = rng.chance(0.6), is_knob = rng.chance(0.6), has_drawers = rng.chance(0.6);
  const int doors = std::max(2, int(std::lround(width / 0.45)));
  const double left = x0 + 0.012, right = x1 - 0.012, low = foot + 0.012,
               high = height - kTop - 0.012;
  const double split = has_drawers ? high - 0.16 : high;
  const double pitch = (right - left) / doors;
  Joiner front(builder, m.cabinet_wood, 0, rng.fork("fronts"), at(0, y0, 0));
  for (int i = 0; i < doors; ++i) {
    const double a = left + i * pitch + 0.0015, b = left + (i + 1) * pitch - 0.0015;
    add_front(front, a, low, b, split - 0.0015, is_framed);
    const double grip = i % 2 == 0 ? b - 0.03 : a + 0.03;
    add_pull(builder, {grip, y0 - 0.018, split - 0.12}, is_knob, false);
    if (!has_drawers) continue;
    add_front(front, a, split + 0.0015, b, high, is_framed);
    add_pull(builder, {(a + b) / 2, y0 - 0.018, (split + high) / 2}, is_knob, true);
  }
  return {finish(builder, {m.cabinet_wood.material, m.brass.material, m.counter.material}), height};
}

Bookcase build_bookcase(double width, double room_height, const RoomMaterials& m, Rng rng) {
  MeshBuilder builder;
  Joiner wood(builder, m.shelf_wood, 0, rng.fork("grain"));
  constexpr double kBoard = 0.022;
  const double height = std::min(room_height - 0.6, rng.uniform(1.75, 2.1));
  const int bays = 4 + int(rng.index(2));
  const double x0 = -width / 2, x1 = width / 2, plinth = 0.07;
  wood.board({x0, -kBookcaseDepth, 0}, {x0 + kBoard, 0, height - kBoard}, 0.002);
  wood.board({x1 - kBoard, -kBookcaseDepth, 0}, {x1, 0, height - kBoard}, 0.002);
  wood.board({x0 - 0.008, -kBookcaseDepth - 0.008, height - kBoard}, {x1 + 0.008, 0, height},
             0.003);
  wood.board({x0 + kBoard, -0.008, plinth}, {x1 - kBoard, 0, height - kBoard}, 0.001);
  wood.board({x0 + kBoard, -kBookcaseDepth + 0.02, 0},
             {x1 - kBoard, -kBookcaseDepth + 0.035, plinth}, 0.001);
  Bookcase result;
  const double clear = height - kBoard - plinth;
  for (int i = 0; i < bays; ++i) {
    const double z = plinth + clear * i / bays;
    wood.board({x0 + kBoard, -kBookcaseDepth + 0.004, z}, {x1 - kBoard, -0.008, z + kBoard},
               0.0015);
    result.shelf_tops.push_back(z + kBoard);
  }
  result.clear_width = width - 2 * kBoard;
  result.clear_height = clear / bays - kBoard;
  result.piece = finish(builder, {m.shelf_wood.material});
  return result;
}

}  // namespace diorama::dining_room
