// SPDX-License-Identifier: Apache-2.0
#include "loader_samples/indoor.h"

#include <cmath>
#include <cstdint>

#include "diorama/rng.h"
#include "modelling/noise.h"

namespace diorama::samples {

using modelling::fractal_noise;
using modelling::lattice_value;

namespace {

struct RoomLook {
  std::string_view name;
  Vec3 half;
  double height, eye;
  Vec3 wall, floor, ceiling;
  double plank_m;
  bool has_boards;
  int lamps_along, lamps_across;
  double lamp_m;  ///< Edge of the ceiling's lamps.
  Vec3 lamp;      ///< 1000 nits.
  int windows;    ///< In each long wall.
  Vec3 window;
  int pieces;
};

const RoomLook kRooms[] = {
    {"Indoor/autoshop_01_4k",
     {7, 5, 0},
     4.5,
     1.6,
     {0.55, 0.56, 0.55},
     {0.30, 0.30, 0.29},
     {0.42, 0.43, 0.44},
     1.2,
     false,
     4,
     2,
     0.9,
     {9, 9.6, 10},
     0,
     {0, 0, 0},
     12},
    {"Indoor/carpentry_shop_01_4k",
     {6, 4, 0},
     3.4,
     1.5,
     {0.46, 0.38, 0.29},
     {0.36, 0.28, 0.20},
     {0.50, 0.46, 0.40},
     0.16,
     true,
     3,
     1,
     0.5,
     {6, 5.4, 4.4},
     3,
     {3.4, 3.8, 4.2},
     16},
    {"Indoor/hotel_room_4k",
     {3.2, 2.6, 0},
     2.6,
     1.4,
     {0.66, 0.61, 0.53},
     {0.24, 0.19, 0.16},
     {0.74, 0.73, 0.70},
     0.0,
     false,
     2,
     1,
     0.35,
     {7, 5.6, 3.8},
     1,
     {4.2, 4.5, 4.8},
     8},
    {"Indoor/wooden_lounge_4k",
     {4.5, 3.5, 0},
     2.8,
     1.5,
     {0.40, 0.26, 0.15},
     {0.30, 0.19, 0.11},
     {0.52, 0.40, 0.28},
     0.14,
     true,
     2,
     2,
     0.4,
     {5.5, 4.4, 3.0},
     2,
     {3.6, 3.8, 4.0},
     11},
};

/// Where the ray leaves the box from inside; the axis of that face.
double way_out(const Vec3& from, const Vec3& direction, const Vec3& min, const Vec3& max,
               int& axis) {
  double nearest = kInfinity;
  for (int i = 0; i < 3; ++i) {
    if (direction[i] == 0.0) continue;
    const double way = ((direction[i] > 0.0 ? max[i] : min[i]) - from[i]) / direction[i];
    if (way >= nearest) continue;
    nearest = way;
    axis = i;
  }
  return nearest;
}

/// Where the ray enters the box from outside; infinite when it does not.
double way_in(const Vec3& from, const Vec3& direction, const Vec3& min, const Vec3& max,
              int& axis) {
  double enters = 0.0;
  double leaves = kInfinity;
  for (int i = 0; i < 3; ++i) {
    if (direction[i] == 0.0) {
      if (from[i] < min[i] || from[i] > max[i]) return kInfinity;
      continue;
    }
    const double a = (min[i] - from[i]) / direction[i];
    const double b = (max[i] - from[i]) / direction[i];
    if (std::min(a, b) > enters) {
      enters = std::min(a, b);
      axis = i;
    }
    leaves = std::min(leaves, std::max(a, b));
  }
  return enters > 0.0 && enters < leaves ? enters : kInfinity;
}

}  // namespace

RoomView::RoomView(std::string_view name) : seed_(stable_hash(name)) {
  const RoomLook* look = &kRooms[0];
  for (const RoomLook& room : kRooms) {
    if (room.name == name) look = &room;
  }
  half_ = look->half;
  height_ = look->height;
  eye_ = Vec3(0.12 * half_.x(), -0.15 * half_.y(), look->eye);
  wall_ = look->wall;
  floor_ = look->floor;
  ceiling_ = look->ceiling;
  plank_m_ = look->plank_m;
  has_boards_ = look->has_boards;
  for (int i = 0; i < look->lamps_along; ++i) {
    for (int k = 0; k < look->lamps_across; ++k) {
      const Vec3 middle((2.0 * (i + 0.5) / look->lamps_along - 1.0) * half_.x(),
                        (2.0 * (k + 0.5) / look->lamps_across - 1.0) * half_.y(), height_);
      const Vec3 reach(0.5 * look->lamp_m, 0.25 * look->lamp_m, 0.0);
      panels_.push_back({2, height_, middle - reach, middle + reach, look->lamp});
    }
  }
  for (int i = 0; i < look->windows; ++i) {
    const double x = (2.0 * (i + 0.5) / look->windows - 1.0) * half_.x();
    const double width = 0.45 * half_.x() / look->windows;
    panels_.push_back({1, half_.y(), Vec3(x - width, half_.y(), 0.35 * height_),
                       Vec3(x + width, half_.y(), 0.82 * height_), look->window});
  }
  Rng rng(seed_);
  for (int i = 0; i < look->pieces; ++i) {
    // Along the walls, turned to them.
    const bool is_long = rng.chance(0.6);
    // One draw a line: arguments are evaluated in whatever order a compiler likes.
    const double high = rng.uniform(0.4, 0.7 * height_);
    const double deep = rng.uniform(0.3, 0.7);
    const double wide = rng.uniform(0.5, 1.6);
    const Vec3 size(wide, deep, high);
    const double side = rng.chance(0.5) ? 1.0 : -1.0;
    Vec3 low;
    Vec3 extent = size;
    if (is_long) {
      low = Vec3(rng.uniform(-half_.x(), half_.x() - size.x()),
                 side > 0 ? half_.y() - size.y() : -half_.y(), 0.0);
    } else {
      extent = Vec3(size.y(), size.x(), size.z());
      low = Vec3(side > 0 ? half_.x() - size.y() : -half_.x(),
                 rng.uniform(-half_.y(), half_.y() - size.x()), 0.0);
    }
    const double tone = rng.uniform(0.12, 0.55);
    const double blue = rng.uniform(0.4, 0.9);
    const double green = rng.uniform(0.5, 0.95);
    const double red = rng.uniform(0.6, 1.0);
    furniture_.push_back({low, low + extent, tone * Vec3(red, green, blue)});
  }
}

/// What the shell of the room looks like.
Vec3 RoomView::surface(int axis, bool is_upper, const Vec3& place) const {
  constexpr int kFar = 4096;
  const double u = axis == 0 ? place.y() : place.x();
  const double v = axis == 2 ? place.y() : place.z();
  const double broad =
      fractal_noise(seed_ + std::uint64_t(axis), u * 0.9 + 900, v * 0.9 + 900, kFar, kFar, 4);
  if (axis == 2 && is_upper) return ceiling_ * (1.0 + 0.05 * broad);
  if (axis != 2) {
    const bool is_skirting = place.z() < 0.12;
    return (is_skirting ? Vec3(0.55 * wall_) : wall_) * (1.0 + 0.08 * broad);
  }
  if (plank_m_ <= 0.0) return floor_ * (1.0 + 0.25 * broad);
  const int row = int(std::floor(v / plank_m_));
  const double along = has_boards_ ? u / 1.8 + lattice_value(seed_ + 9, row, 0) : u / plank_m_;
  const int column = int(std::floor(along));
  const bool is_joint = std::abs(v / plank_m_ - row) < 0.03 || std::abs(along - column) < 0.004;
  const double tone = 0.75 + 0.5 * lattice_value(seed_ + 11, row, column);
  return floor_ * (is_joint ? 0.4 : tone) * (1.0 + 0.15 * broad);
}

RoomView::Hit RoomView::first_hit(const Vec3& direction) const {
  int axis = 2;
  double way = way_out(eye_, direction, Vec3(-half_.x(), -half_.y(), 0.0),
                       Vec3(half_.x(), half_.y(), height_), axis);
  Hit hit;
  hit.place = eye_ + way * direction;
  const bool is_upper = direction[axis] > 0.0;
  hit.normal = Vec3::Zero();
  hit.normal[axis] = is_upper ? -1.0 : 1.0;
  hit.albedo = surface(axis, is_upper, hit.place);
  for (const Panel& panel : panels_) {
    if (panel.axis != axis || std::abs(hit.place[axis] - panel.plane) > 1e-6) continue;
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const bool is_in = hit.place[a] > panel.min[a] && hit.place[a] < panel.max[a] &&
                       hit.place[b] > panel.min[b] && hit.place[b] < panel.max[b];
    if (is_in) hit.light = panel.light;
  }
  for (const Box& box : furniture_) {
    int face = 2;
    const double nearer = way_in(eye_, direction, box.min, box.max, face);
    if (nearer >= way) continue;
    way = nearer;
    hit.place = eye_ + way * direction;
    hit.normal = Vec3::Zero();
    hit.normal[face] = direction[face] > 0.0 ? -1.0 : 1.0;
    // Shelves and drawers.
    const double shelf = std::fmod(hit.place.z(), 0.35);
    hit.albedo = box.albedo * (face != 2 && shelf < 0.03 ? 0.45 : 1.0);
    hit.light = Vec3::Zero();
  }
  return hit;
}

/// Of lamps and windows as points, and of what the walls throw back.
Vec3 RoomView::irradiance(const Vec3& place, const Vec3& normal) const {
  Vec3 sum = Vec3::Zero();
  Vec3 power = Vec3::Zero();
  for (const Panel& panel : panels_) {
    const Vec3 size = panel.max - panel.min;
    const double area = panel.axis == 2 ? size.x() * size.y() : size.x() * size.z();
    const Vec3 way = 0.5 * (panel.min + panel.max) - place;
    const double square = way.squaredNorm() + 0.25 * area;
    const Vec3 to = way.normalized();
    const double here = std::max(0.0, to.dot(normal));
    const double there = std::abs(to[panel.axis]);
    sum += panel.light * (area * here * there / square);
    power += panel.light * (kPi * area);
  }
  const double walls = 8.0 * half_.x() * half_.y() + 4.0 * height_ * (half_.x() + half_.y());
  return sum + power * (0.9 / walls);
}

Vec3 RoomView::radiance(const Vec3& direction) const {
  const Hit hit = first_hit(direction);
  if (hit.light.maxCoeff() > 0.0) return hit.light;
  return hit.albedo.cwiseProduct(irradiance(hit.place, hit.normal)) / kPi;
}

}  // namespace diorama::samples
