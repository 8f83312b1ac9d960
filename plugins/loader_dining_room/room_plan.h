// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "diorama/math.h"
#include "diorama/rng.h"

namespace diorama::dining_room {

/// A hole in a wall, in the wall's space: x to the right as seen from inside, z up.
struct WallOpening {
  int wall = 0;
  double centre = 0.0;
  double width = 1.0;
  double sill = 0.0;
  double height = 2.0;
};

enum class TableShape { Rectangle, Square, Round };

/// Something with a rectangular footprint against a wall.
struct WallSpot {
  int wall = 0;
  double centre = 0.0;  ///< Along the wall.
  double width = 1.0;
};

/// Where everything goes. Room space: the inner floor spans (0, 0) to (width, depth) at z = 0.
/// Walls 0..3: south (y = 0), east, north, west.
struct RoomPlan {
  double width = 5.0;
  double depth = 4.0;
  double height = 2.9;
  double wall_thickness = 0.25;
  WallOpening door;
  std::vector<WallOpening> windows;

  TableShape table_shape = TableShape::Rectangle;
  double table_length = 1.8;  ///< Along x.
  double table_width = 1.0;
  double table_height = 0.75;
  Vec2 table_centre = Vec2::Zero();
  double rug_thickness = 0.0;  ///< 0: no rug.
  Vec2 rug_size = Vec2::Zero();

  struct Seat {
    Vec2 place = Vec2::Zero();    ///< Of the seat's centre.
    double yaw = 0.0;             ///< The chair looks along its +y.
    Vec2 setting = Vec2::Zero();  ///< Where its plate goes.
  };
  std::vector<Seat> seats;

  WallSpot sideboard;
  std::optional<WallSpot> bookcase;
  std::vector<WallSpot> pictures;
  std::optional<Vec2> floor_plant;

  double wall_length(int wall) const { return wall % 2 == 0 ? width : depth; }
  /// Wall space: origin at the left inner corner as seen from inside, x to the right, y outwards.
  Affine room_from_wall(int wall) const;
};

constexpr double kSideboardDepth = 0.44;
constexpr double kBookcaseDepth = 0.30;
constexpr double kSeatDepth = 0.44;

RoomPlan plan_room(Rng rng);

}  // namespace diorama::dining_room
