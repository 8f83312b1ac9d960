// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/room_plan.h"

#include <algorithm>
#include <cmath>

#include "modelling/mesh_builder.h"

namespace diorama::dining_room {
namespace {

constexpr double kGap = 0.12;  ///< Between things that stand along one wall.

/// Which parts of the walls are taken.
class WallUse {
 public:
  explicit WallUse(const RoomPlan& plan) : plan_(plan) {}

  void take(int wall, double centre, double width) {
    taken_[std::size_t(wall)].push_back({centre - width / 2, centre + width / 2});
  }
  /// The centre of a free stretch of this width nearest to `wish`, keeping `margin` to the corners.
  std::optional<double> find(int wall, double width, double wish, double margin) const {
    const double low = margin + width / 2;
    const double high = plan_.wall_length(wall) - low;
    std::optional<double> best;
    for (double centre = low; centre <= high + 1e-9; centre += 0.05) {
      const bool is_free = std::none_of(
          taken_[std::size_t(wall)].begin(), taken_[std::size_t(wall)].end(), [&](const Range& r) {
            return centre + width / 2 + kGap > r.lo && centre - width / 2 - kGap < r.hi;
          });
      if (is_free && (!best || std::abs(centre - wish) < std::abs(*best - wish))) best = centre;
    }
    return best;
  }

 private:
  struct Range {
    double lo;
    double hi;
  };
  const RoomPlan& plan_;
  std::array<std::vector<Range>, 4> taken_;
};

double on_grid(double metres, double step) { return std::ceil(metres / step - 1e-9) * step; }

void plan_table(RoomPlan& plan, Rng rng) {
  const double kind = rng.uniform();
  if (kind < 0.15) {
    plan.table_shape = TableShape::Round;
    plan.table_length = plan.table_width = rng.uniform(1.15, 1.45);
  } else if (kind < 0.3) {
    plan.table_shape = TableShape::Square;
    plan.table_length = plan.table_width = rng.uniform(1.0, 1.16);
  } else {
    plan.table_length = rng.uniform(1.45, 2.5);
    plan.table_width = rng.uniform(0.91, 1.12);
  }
  plan.table_height = rng.uniform(0.70, 0.79);
}

void plan_size(RoomPlan& plan, Rng rng) {
  constexpr double kChairZone = 0.75;
  plan.width = on_grid(plan.table_length + 2 * kChairZone + 2 * rng.uniform(0.55, 0.95), 0.5);
  plan.depth = on_grid(plan.table_width + 2 * kChairZone + 2 * rng.uniform(0.55, 0.85), 0.5);
  plan.height = rng.uniform(2.8, 3.2);
  plan.wall_thickness = rng.uniform(0.2, 0.3);
}

void plan_windows(RoomPlan& plan, int wall, Rng rng) {
  const double length = plan.wall_length(wall);
  const int count = length > 4.4 && rng.chance(0.6) ? 2 : 1;
  WallOpening window;
  window.wall = wall;
  window.sill = rng.chance(0.25) ? 0.35 : rng.uniform(0.8, 0.95);
  window.height = std::min(plan.height - 0.4, rng.uniform(2.15, 2.35)) - window.sill;
  window.width = count == 2 ? rng.uniform(1.0, 1.4) : rng.uniform(1.3, 2.0);
  for (int i = 0; i < count; ++i) {
    window.centre = length * (count == 2 ? (i == 0 ? 0.28 : 0.72) : rng.uniform(0.45, 0.55));
    plan.windows.push_back(window);
  }
}

void plan_openings(RoomPlan& plan, WallUse& use, Rng rng) {
  const int door_wall = int(rng.index(4));
  plan.door.wall = door_wall;
  plan.door.width = rng.uniform(0.86, 0.96);
  plan.door.height = rng.uniform(2.02, 2.12);
  const double length = plan.wall_length(door_wall);
  plan.door.centre =
      rng.chance(0.5) ? 0.35 + plan.door.width / 2 : length - 0.35 - plan.door.width / 2;
  use.take(door_wall, plan.door.centre, plan.door.width + 0.25);

  const int turn = rng.chance(0.5) ? 1 : 3;
  plan_windows(plan, (door_wall + 2) % 4, rng.fork("windows"));
  if (rng.chance(0.5)) plan_windows(plan, (door_wall + turn) % 4, rng.fork("more windows"));
  for (const WallOpening& w : plan.windows) use.take(w.wall, w.centre, w.width + 0.5);
}

void plan_seats(RoomPlan& plan, Rng rng) {
  const double reach = kSeatDepth / 2 - 0.10;  // the front of the seat is 10 cm under the top
  const auto add = [&](const Vec2& edge, const Vec2& outwards, double yaw) {
    RoomPlan::Seat seat;
    const double pulled = rng.uniform(0.0, 0.14);
    seat.place = plan.table_centre + edge + outwards * (reach + pulled);
    seat.yaw = yaw + rng.uniform(-0.10, 0.10);
    seat.setting = plan.table_centre + edge - outwards * 0.17;
    plan.seats.push_back(seat);
  };
  if (plan.table_shape == TableShape::Round) {
    const int count = plan.table_length > 1.3 ? 5 : 4;
    const double start = rng.uniform(0, kPi);
    for (int i = 0; i < count; ++i) {
      const double angle = start + 2 * kPi * i / count;
      const Vec2 out(std::cos(angle), std::sin(angle));
      add(out * plan.table_length / 2, out, angle + kPi / 2);
    }
    return;
  }
  const int per_side = plan.table_shape == TableShape::Square ? 1
                       : plan.table_length > 2.05             ? 3
                                                              : 2;
  const double between = (plan.table_length - 0.30) / per_side;
  for (int i = 0; i < per_side; ++i) {
    const double x = (i - 0.5 * (per_side - 1)) * between;
    add({x, -plan.table_width / 2}, {0, -1}, 0);
    add({x, plan.table_width / 2}, {0, 1}, kPi);
  }
  const bool must_fill = per_side == 1;
  if (must_fill || rng.chance(0.6)) add({plan.table_length / 2, 0}, {1, 0}, kPi / 2);
  if (must_fill || rng.chance(0.6)) add({-plan.table_length / 2, 0}, {-1, 0}, -kPi / 2);
}

void plan_rug(RoomPlan& plan, Rng rng) {
  if (!rng.chance(0.7)) return;
  plan.rug_thickness = rng.uniform(0.008, 0.014);
  // Large enough for every chair, pulled out as far as it may be.
  const double beyond = 2 * (kSeatDepth + 0.18);
  plan.rug_size = Vec2(plan.table_length + beyond, plan.table_width + beyond);
}

void plan_furniture(RoomPlan& plan, WallUse& use, Rng rng) {
  const double wish_width = rng.uniform(1.2, 1.7);
  for (const double shrink : {1.0, 0.8, 0.6}) {
    for (int turn = 0; turn < 4 && plan.sideboard.width != wish_width * shrink; ++turn) {
      const int wall = (plan.door.wall + (turn == 0 ? 1 : turn == 1 ? 3 : turn == 2 ? 0 : 2)) % 4;
      const double width = wish_width * shrink;
      const auto centre = use.find(wall, width, plan.wall_length(wall) / 2, 0.15);
      if (centre) plan.sideboard = {wall, *centre, width};
    }
    if (plan.sideboard.width == wish_width * shrink) break;
  }
  use.take(plan.sideboard.wall, plan.sideboard.centre, plan.sideboard.width);

  const double case_width = rng.uniform(0.75, 1.1);
  for (int turn = 0; turn < 4 && !plan.bookcase; ++turn) {
    const int wall = (plan.door.wall + turn) % 4;
    if (wall == plan.sideboard.wall) continue;
    const auto centre = use.find(wall, case_width, rng.chance(0.5) ? 0 : 9, 0.5);
    if (centre) plan.bookcase = WallSpot{wall, *centre, case_width};
  }
  if (plan.bookcase) use.take(plan.bookcase->wall, plan.bookcase->centre, case_width);
}

void plan_pictures(RoomPlan& plan, WallUse& use, Rng rng) {
  plan.pictures.push_back({plan.sideboard.wall, plan.sideboard.centre, rng.uniform(0.7, 1.1)});
  for (int wall = 0; wall < 4; ++wall) {
    const double width = rng.uniform(0.45, 0.8);
    const auto centre = use.find(wall, width, plan.wall_length(wall) / 2, 0.3);
    if (!centre || !rng.chance(0.75)) continue;
    plan.pictures.push_back({wall, *centre, width});
    use.take(wall, *centre, width);
  }
}

/// A corner of the room that no furniture and no door needs.
void plan_plant(RoomPlan& plan, Rng rng) {
  constexpr double kInset = 0.36;
  const auto is_near = [&](int wall, double centre, double width, const Vec2& p) {
    const Vec3 a = plan.room_from_wall(wall) * Vec3(centre - width / 2, 0, 0);
    const Vec3 b = plan.room_from_wall(wall) * Vec3(centre + width / 2, 0, 0);
    const Vec2 ab = (b - a).head<2>();
    const double t = std::clamp(ab.dot(p - a.head<2>()) / ab.squaredNorm(), 0.0, 1.0);
    return (p - a.head<2>() - t * ab).norm() < 0.85;
  };
  const std::size_t start = rng.index(4);
  for (std::size_t k = 0; k < 4; ++k) {
    const std::size_t corner = (start + k) % 4;
    const Vec2 p(corner % 2 == 0 ? kInset : plan.width - kInset,
                 corner / 2 == 0 ? kInset : plan.depth - kInset);
    if (is_near(plan.door.wall, plan.door.centre, plan.door.width, p)) continue;
    if (is_near(plan.sideboard.wall, plan.sideboard.centre, plan.sideboard.width, p)) continue;
    if (plan.bookcase &&
        is_near(plan.bookcase->wall, plan.bookcase->centre, plan.bookcase->width, p)) {
      continue;
    }
    const bool is_in_the_way =
        std::any_of(plan.seats.begin(), plan.seats.end(),
                    [&](const auto& s) { return (s.place - p).norm() < 0.85; });
    if (is_in_the_way) continue;
    plan.floor_plant = p;
    return;
  }
}

}  // namespace

Affine RoomPlan::room_from_wall(int wall) const {
  using modelling::at;
  using modelling::turned_z;
  switch (wall) {
    case 0:
      return at(width, 0, 0) * turned_z(kPi);
    case 1:
      return at(width, depth, 0) * turned_z(-kPi / 2);
    case 2:
      return at(0, depth, 0);
    default:
      return turned_z(kPi / 2);
  }
}

RoomPlan plan_room(Rng rng) {
  RoomPlan plan;
  plan_table(plan, rng.fork("table"));
  plan_size(plan, rng.fork("size"));
  WallUse use(plan);
  plan_openings(plan, use, rng.fork("openings"));
  plan_furniture(plan, use, rng.fork("furniture"));
  // The table stands in the middle of what the sideboard leaves free.
  const Vec3 inwards = plan.room_from_wall(plan.sideboard.wall).linear() * Vec3(0, -1, 0);
  plan.table_centre = Vec2(plan.width / 2, plan.depth / 2) + 0.12 * inwards.head<2>();
  plan_seats(plan, rng.fork("seats"));
  plan_rug(plan, rng.fork("rug"));
  plan_pictures(plan, use, rng.fork("pictures"));
  plan_plant(plan, rng.fork("plant"));
  return plan;
}

}  // namespace diorama::dining_room
