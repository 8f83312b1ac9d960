// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/room_shell.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "loader_dining_room/piece.h"
#include "modelling/shapes.h"

namespace diorama::dining_room {

using namespace modelling;

namespace {

constexpr double kInnerShare = 0.6;  ///< Of the wall's thickness; the rest is the exterior.
constexpr double kSlab = 0.2;        ///< Floor and ceiling.

std::vector<Opening> openings_of(const RoomPlan& plan, int wall, double x_shift) {
  std::vector<Opening> openings;
  const auto add = [&](const WallOpening& o) {
    if (o.wall != wall) return;
    openings.push_back({o.centre - o.width / 2 + x_shift, o.centre + o.width / 2 + x_shift, o.sill,
                        o.sill + o.height});
  };
  add(plan.door);
  for (const WallOpening& w : plan.windows) add(w);
  return openings;
}

/// A ring of four panels around the room, from `inset` to `inset + thickness` behind the surface.
void add_wall_ring(MeshBuilder& builder, const RoomPlan& plan, double inset, double thickness,
                   double repeats_per_m) {
  for (int wall = 0; wall < 4; ++wall) {
    // North and south walls cover the corners.
    const double beyond = wall % 2 == 0 ? inset + thickness : inset;
    const double length = plan.wall_length(wall) + 2 * beyond;
    builder.begin(plan.room_from_wall(wall) * at(-beyond, inset, 0),
                  {0, repeats_per_m, Vec2(0.37 * wall, 0)});
    add_panel(builder, length, thickness, plan.height, openings_of(plan, wall, beyond));
  }
}

Piece slab(const RoomPlan& plan, double z_low, const Finish& finish_of) {
  MeshBuilder builder;
  const double t = plan.wall_thickness;
  builder.begin(at(-t, -t, z_low), {0, finish_of.repeats_per_m});
  const std::array<Vec2, 4> outline{Vec2(0, 0), Vec2(plan.width + 2 * t, 0),
                                    Vec2(plan.width + 2 * t, plan.depth + 2 * t),
                                    Vec2(0, plan.depth + 2 * t)};
  add_prism(builder, outline, kSlab, 0.0);
  return finish(builder, {finish_of.material});
}

std::vector<Vec2> inner_rectangle(const RoomPlan& plan) {
  return {{0, 0}, {plan.width, 0}, {plan.width, plan.depth}, {0, plan.depth}};
}

/// Along the foot of the walls, from one side of the door around to the other.
Piece skirting(const RoomPlan& plan, const Finish& trim, double height) {
  const Affine room_from_wall = plan.room_from_wall(plan.door.wall);
  const double casing = plan.door.width / 2 + 0.085;
  // The room turns counter-clockwise, which runs leftwards on every wall as seen from inside.
  std::vector<Vec2> path{(room_from_wall * Vec3(plan.door.centre - casing, 0, 0)).head<2>()};
  const std::vector<Vec2> corners = inner_rectangle(plan);
  const std::array<std::size_t, 4> next_corner{1, 2, 3, 0};
  // Walking counter-clockwise along the south wall ends at corner 1, and so on.
  std::size_t corner = next_corner[std::size_t(plan.door.wall)];
  path[0] = (room_from_wall * Vec3(plan.door.centre - casing, 0, 0)).head<2>();
  for (int i = 0; i < 4; ++i) path.push_back(corners[(corner + std::size_t(i)) % 4]);
  path.push_back((room_from_wall * Vec3(plan.door.centre + casing, 0, 0)).head<2>());
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, trim.repeats_per_m});
  const std::array<Vec2, 6> section{
      Vec2(0, 0),          Vec2(0.018, 0), Vec2(0.018, height - 0.022), Vec2(0.013, height - 0.010),
      Vec2(0.008, height), Vec2(0, height)};
  add_moulding(builder, section, path, false);
  return finish(builder, {trim.material});
}

Piece cornice(const RoomPlan& plan, const Finish& trim, double size) {
  MeshBuilder builder;
  builder.begin(at(0, 0, plan.height), {0, trim.repeats_per_m});
  std::vector<Vec2> section{{0, -size}};
  for (int i = 0; i <= 6; ++i) {
    const double a = kPi / 2 * i / 6;
    section.emplace_back(0.012 + (size - 0.012) * (1 - std::cos(a)),
                         -size + (size - 0.012) * std::sin(a));
  }
  section.emplace_back(size, 0);
  section.emplace_back(0, 0);
  add_moulding(builder, section, inner_rectangle(plan), true);
  return finish(builder, {trim.material});
}

/// A bar of a frame between two corners of its front, in wall space.
void add_bar(MeshBuilder& builder, const Affine& room_from_wall, const Finish& finish_of,
             const Vec3& low, const Vec3& high, double bevel = 0.003, std::uint16_t slot = 0) {
  const Vec3 size = high - low;
  int longest = 0;
  size.maxCoeff(&longest);
  builder.begin(room_from_wall * at((low + high) / 2),
                {slot, finish_of.repeats_per_m, Vec2(low.x() + low.z(), low.z())});
  add_box(builder, size, bevel, Axis(longest));
}

/// Architrave around an opening on the inside of the wall; to the floor for doors.
void add_casing(MeshBuilder& builder, const Affine& from_wall, const Finish& trim,
                const WallOpening& o, bool has_bottom) {
  constexpr double kWidth = 0.075, kDepth = 0.018;
  const double x0 = o.centre - o.width / 2, x1 = o.centre + o.width / 2;
  const double z0 = has_bottom ? o.sill - kWidth : o.sill;
  const double z1 = o.sill + o.height;
  add_bar(builder, from_wall, trim, {x0 - kWidth, -kDepth, z0}, {x0, 0, z1}, 0.005);
  add_bar(builder, from_wall, trim, {x1, -kDepth, z0}, {x1 + kWidth, 0, z1}, 0.005);
  add_bar(builder, from_wall, trim, {x0 - kWidth, -kDepth - 0.003, z1},
          {x1 + kWidth, 0, z1 + kWidth}, 0.005);
  if (has_bottom) add_bar(builder, from_wall, trim, {x0, -kDepth, z0}, {x1, 0, o.sill}, 0.005);
}

struct WindowStyle {
  int columns = 2;
  int rows = 1;
  bool has_casing = true;
};

void build_window(const RoomPlan& plan, const RoomMaterials& m, const WallOpening& o,
                  const WindowStyle& style, const Rng& rng, Scene& scene, NodeId parent,
                  const Affine& parent_from_room) {
  const Affine from_wall = plan.room_from_wall(o.wall);
  const double x0 = o.centre - o.width / 2, x1 = o.centre + o.width / 2;
  const double z0 = o.sill, z1 = o.sill + o.height;
  const double y0 = plan.wall_thickness * 0.55, y1 = y0 + 0.06;
  constexpr double kFrame = 0.055, kSash = 0.042, kBar = 0.022;
  MeshBuilder frame, panes;
  const Finish& paint = m.window_frame;
  const auto bar = [&](const Vec3& low, const Vec3& high) {
    add_bar(frame, from_wall, paint, low, high);
  };
  bar({x0, y0, z0}, {x0 + kFrame, y1, z1});
  bar({x1 - kFrame, y0, z0}, {x1, y1, z1});
  bar({x0 + kFrame, y0, z0}, {x1 - kFrame, y1, z0 + kFrame});
  bar({x0 + kFrame, y0, z1 - kFrame}, {x1 - kFrame, y1, z1});
  const double inner = x1 - x0 - 2 * kFrame;
  for (int c = 0; c < style.columns; ++c) {
    const double a = x0 + kFrame + inner * c / style.columns;
    const double b = x0 + kFrame + inner * (c + 1) / style.columns;
    const double low = z0 + kFrame, high = z1 - kFrame;
    bar({a, y0 - 0.012, low}, {a + kSash, y1 - 0.015, high});
    bar({b - kSash, y0 - 0.012, low}, {b, y1 - 0.015, high});
    bar({a + kSash, y0 - 0.012, low}, {b - kSash, y1 - 0.015, low + kSash});
    bar({a + kSash, y0 - 0.012, high - kSash}, {b - kSash, y1 - 0.015, high});
    for (int r = 1; r < style.rows; ++r) {
      const double z = low + kSash + (high - low - 2 * kSash) * r / style.rows;
      bar({a + kSash, y0, z - kBar / 2}, {b - kSash, y1 - 0.02, z + kBar / 2});
    }
    panes.begin(from_wall * at((a + b) / 2, y0 + 0.018, (low + high) / 2), {0, 1.0});
    add_box(panes, Vec3(b - a - 2 * kSash + 0.006, 0.004, high - low - 2 * kSash + 0.006), 0.0005,
            Axis::X);
  }
  // A lever on the sash in the middle.
  const double grip_x = x0 + kFrame + inner / style.columns - kSash / 2;
  const double grip_z = (z0 + z1) / 2;
  frame.begin(from_wall * at(grip_x, y0 - 0.018, grip_z), {1, 1.0});
  add_box(frame, Vec3(0.024, 0.012, 0.07), 0.004, Axis::Z);
  const std::array<Vec3, 3> lever{Vec3(0, -0.006, 0), Vec3(0, -0.03, 0), Vec3(0, -0.032, -0.1)};
  add_tube(frame, smooth_path(lever, 4), 0.007, 10);
  // The sill board and, outside, the weathered one.
  add_bar(frame, from_wall, m.trim, {x0 - 0.04, -0.05, z0 - 0.028}, {x1 + 0.04, 0, z0}, 0.008, 2);
  add_bar(frame, from_wall, m.trim, {x0, 0, z0 - 0.001}, {x1, y0, z0 + 0.012}, 0.002, 2);
  add_bar(frame, from_wall, m.trim, {x0, y1, z0}, {x1, plan.wall_thickness + 0.03, z0 + 0.015},
          0.004, 2);
  if (style.has_casing) {
    MeshBuilder casing;
    WallOpening above = o;
    add_casing(casing, from_wall, m.trim, above, false);
    place(scene, parent, factory_name("WindowFactory", rng, "_002"),
          finish(casing, {m.trim.material}), parent_from_room);
  }
  place(scene, parent, factory_name("WindowFactory", rng),
        finish(frame, {paint.material, m.brass.material, m.trim.material}), parent_from_room);
  place(scene, parent, factory_name("WindowFactory", rng, "_SPLIT_GLASS"),
        finish(panes, {m.pane.material}), parent_from_room);
}

/// Two drawn curtains and their rod.
void build_curtains(const RoomPlan& plan, const RoomMaterials& m, const WallOpening& o, Rng rng,
                    Scene& scene, NodeId parent, const Affine& parent_from_room) {
  const Affine from_wall = plan.room_from_wall(o.wall);
  const double z_rod = std::min(plan.height - 0.12, o.sill + o.height + 0.16);
  const double bottom = rng.chance(0.65) ? 0.02 : std::max(0.12, o.sill - 0.18);
  constexpr double kOut = 0.10;
  const double half = o.width / 2 + 0.20;
  MeshBuilder builder;
  builder.begin(from_wall * at(o.centre, -kOut, z_rod) * turned_y(kPi / 2), {1, 1.0});
  const double finial = 0.03;
  const std::array<ProfilePoint, 8> rod{{{0, -half - 2 * finial},
                                         {0.016, -half - 1.5 * finial},
                                         {0.018, -half - 0.6 * finial},
                                         {0.010, -half},
                                         {0.010, half},
                                         {0.018, half + 0.6 * finial},
                                         {0.016, half + 1.5 * finial},
                                         {0, half + 2 * finial}}};
  add_lathe(builder, rod, 16, 1.2);
  for (const double side : {-1.0, 1.0}) {
    const double x = o.centre + side * (half - 0.03);
    builder.begin(from_wall * at(x, -kOut / 2, z_rod), {1, 1.0});
    add_box(builder, Vec3(0.014, kOut, 0.014), 0.003, Axis::Y);
    builder.begin(from_wall * at(x, -0.005, z_rod), {1, 1.0});
    add_box(builder, Vec3(0.03, 0.01, 0.07), 0.003, Axis::Z);
  }
  const double drawn = std::min(0.34 * o.width, 0.42);
  const int folds = 5 + int(rng.index(3));
  for (const double side : {-1.0, 1.0}) {
    const double phase = rng.uniform(0, 2 * kPi);
    const double outer = o.centre + side * (half - 0.05);
    builder.begin(from_wall, {0, m.curtain.repeats_per_m});
    const auto surface = [&](double u, double v) {
      const double across = side < 0 ? u : 1 - u;
      const double z = std::lerp(bottom, z_rod - 0.012, v);
      // Folds are deep at the foot and gathered under the rod.
      const double depth = 0.030 * (1 - 0.45 * v);
      const double sway = 0.012 * std::sin(3.1 * v + phase) * (1 - v);
      const double x = outer - side * across * drawn * (1 + 0.10 * (1 - v)) + sway;
      const double y = -kOut + depth * std::sin(2 * kPi * folds * across + phase) *
                                   std::sin(kPi * (0.08 + 0.84 * across));
      return Vec3(x, y, z);
    };
    add_sheet(builder, folds * 12, 24, 0.003, surface, Vec2(drawn * 2, z_rod - bottom));
  }
  place(scene, parent, factory_name("WindowFactory", rng.fork("curtain"), "_001"),
        finish(builder, {m.curtain.material, m.brass.material}), parent_from_room);
}

void add_door_leaf(MeshBuilder& builder, const Affine& from_wall, const RoomMaterials& m,
                   const Vec3& low, const Vec3& high, int panel_rows) {
  constexpr double kStile = 0.11, kRecess = 0.010;
  const Finish& wood = m.door_wood;
  const auto bar = [&](double x0, double z0, double x1, double z1, double inset) {
    add_bar(builder, from_wall, wood, {x0, low.y() + inset, z0}, {x1, high.y() - inset, z1}, 0.003);
  };
  bar(low.x(), low.z(), low.x() + kStile, high.z(), 0);
  bar(high.x() - kStile, low.z(), high.x(), high.z(), 0);
  const double x0 = low.x() + kStile, x1 = high.x() - kStile, middle = (x0 + x1) / 2;
  double z = low.z();
  const double clear = high.z() - low.z() - 0.2 - (panel_rows)*kStile;
  for (int r = 0; r <= panel_rows; ++r) {
    const double rail = r == 0 ? 0.2 : kStile;
    bar(x0, z, x1, z + rail, 0);
    z += rail;
    if (r == panel_rows) break;
    const double share = panel_rows == 1   ? 1.0
                         : panel_rows == 2 ? (r == 0 ? 0.42 : 0.58)
                                           : 1.0 / panel_rows;
    const double top = z + clear * share;
    bar(middle - kStile / 2, z, middle + kStile / 2, top, 0);
    for (const auto& [a, b] :
         {std::pair{x0, middle - kStile / 2}, std::pair{middle + kStile / 2, x1}}) {
      bar(a, z, b, top, kRecess);
      add_bar(builder, from_wall, wood, {a + 0.03, low.y() + 0.004, z + 0.03},
              {b - 0.03, high.y() - 0.004, top - 0.03}, 0.006);
    }
    z = top;
  }
}

void build_door(const RoomPlan& plan, const RoomMaterials& m, Rng rng, Scene& scene, NodeId parent,
                const Affine& parent_from_room) {
  const WallOpening& o = plan.door;
  const Affine from_wall = plan.room_from_wall(o.wall);
  const double x0 = o.centre - o.width / 2, x1 = o.centre + o.width / 2, z1 = o.height;
  const double t = plan.wall_thickness;
  constexpr double kLining = 0.03;
  MeshBuilder frame;
  const Finish& trim = m.trim;
  add_bar(frame, from_wall, trim, {x0, 0, 0}, {x0 + kLining, t, z1});
  add_bar(frame, from_wall, trim, {x1 - kLining, 0, 0}, {x1, t, z1});
  add_bar(frame, from_wall, trim, {x0 + kLining, 0, z1 - kLining}, {x1 - kLining, t, z1});
  // Stops behind the leaf close the gaps around it.
  const double y = 0.045;
  constexpr double kStop = 0.014;
  add_bar(frame, from_wall, trim, {x0 + kLining, y + 0.042, 0},
          {x0 + kLining + kStop, y + 0.06, z1 - kLining});
  add_bar(frame, from_wall, trim, {x1 - kLining - kStop, y + 0.042, 0},
          {x1 - kLining, y + 0.06, z1 - kLining});
  add_bar(frame, from_wall, trim, {x0 + kLining + kStop, y + 0.042, z1 - kLining - kStop},
          {x1 - kLining - kStop, y + 0.06, z1 - kLining});
  add_bar(frame, from_wall, trim, {x0 + kLining + kStop, y + 0.042, 0},
          {x1 - kLining - kStop, y + 0.06, 0.012});
  add_casing(frame, from_wall, trim, o, false);
  place(scene, parent, factory_name("DoorCasingFactory", rng), finish(frame, {trim.material}),
        parent_from_room);

  MeshBuilder leaf;
  const Vec3 low(x0 + kLining + 0.002, y, 0.003),
      high(x1 - kLining - 0.002, y + 0.04, z1 - kLining - 0.002);
  add_door_leaf(leaf, from_wall, m, low, high, 1 + int(rng.index(3)));
  const bool is_left = rng.chance(0.5);
  const double grip = is_left ? low.x() + 0.055 : high.x() - 0.055;
  const double inward = is_left ? 1 : -1;
  for (const double side : {-1.0, 1.0}) {
    const double surface = side < 0 ? low.y() : high.y();
    leaf.begin(from_wall * at(grip, surface, 1.02) * turned_x(side < 0 ? kPi / 2 : -kPi / 2),
               {1, 1.0});
    const std::array<ProfilePoint, 4> rose{{{0, 0}, {0.026, 0}, {0.024, 0.007}, {0, 0.008}}};
    add_lathe(leaf, rose, 24);
    leaf.begin(from_wall * at(grip, surface, 1.02), {1, 1.0});
    const std::array<Vec3, 4> lever{Vec3(0, 0, 0), Vec3(0, side * 0.042, 0),
                                    Vec3(inward * 0.03, side * 0.052, 0),
                                    Vec3(inward * 0.12, side * 0.05, 0)};
    add_tube(leaf, smooth_path(lever, 6), 0.009, 14);
    add_bar(leaf, from_wall, m.brass, {grip - 0.011, surface + (side < 0 ? -0.003 : 0), 0.90},
            {grip + 0.011, surface + (side < 0 ? 0 : 0.003), 0.95}, 0.001, 1);
  }
  place(scene, parent, factory_name("PanelDoorFactory", rng),
        finish(leaf, {m.door_wood.material, m.brass.material}), parent_from_room);
}

}  // namespace

void build_shell(const RoomPlan& plan, const RoomMaterials& m, const Rng& rng, Scene& scene,
                 NodeId parent, const Affine& parent_from_room) {
  const double inner = plan.wall_thickness * kInnerShare;
  MeshBuilder walls, exterior;
  add_wall_ring(walls, plan, 0, inner, m.wall.repeats_per_m);
  add_wall_ring(exterior, plan, inner, plan.wall_thickness - inner, m.exterior.repeats_per_m);
  const auto put = [&](const char* name, const Piece& piece) {
    place(scene, parent, name, piece, parent_from_room);
  };
  put("dining_room_0_0_floor", slab(plan, -kSlab, m.floor));
  put("dining_room_0_0_wall", finish(walls, {m.wall.material}));
  put("dining_room_0_0_ceiling", slab(plan, plan.height, m.ceiling));
  put("dining_room_0_0_exterior", finish(exterior, {m.exterior.material}));
  Rng sizes = rng.fork("trim");
  put("skirtingboard_support", skirting(plan, m.trim, sizes.uniform(0.07, 0.13)));
  put("skirtingboard_ceiling", cornice(plan, m.trim, sizes.uniform(0.05, 0.11)));

  Rng style_rng = rng.fork("window style");
  WindowStyle style;
  style.rows = 1 + int(style_rng.index(3));
  style.has_casing = style_rng.chance(0.6);
  const bool has_curtains = style_rng.chance(0.8);
  for (std::size_t i = 0; i < plan.windows.size(); ++i) {
    const Rng own = rng.fork("window").fork(i);
    style.columns = plan.windows[i].width > 1.7 ? 3 : 2;
    build_window(plan, m, plan.windows[i], style, own, scene, parent, parent_from_room);
    if (has_curtains)
      build_curtains(plan, m, plan.windows[i], own, scene, parent, parent_from_room);
  }
  build_door(plan, m, rng.fork("door"), scene, parent, parent_from_room);
}

}  // namespace diorama::dining_room
