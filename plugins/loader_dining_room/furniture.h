// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "loader_dining_room/piece.h"
#include "loader_dining_room/room_materials.h"
#include "loader_dining_room/room_plan.h"

/// Furniture. Each piece is built standing on z = 0 about the z axis; things against a wall have
/// their back at y = 0 and look along -y.
namespace diorama::dining_room {

Piece build_table(const RoomPlan& plan, const RoomMaterials& materials, Rng rng);
/// Looks along +y; the seat is kSeatDepth deep. `table_height` sets the height of the seat.
Piece build_chair(double table_height, const RoomMaterials& materials, Rng rng);

struct Cabinet {
  Piece piece;
  double height = 0.85;
};
/// `width` along x, kSideboardDepth deep.
Cabinet build_sideboard(double width, const RoomMaterials& materials, Rng rng);

struct Bookcase {
  Piece piece;
  std::vector<double> shelf_tops;  ///< Upper sides of the boards that things stand on.
  double clear_width = 0.0;        ///< Between the sides.
  double clear_height = 0.0;       ///< Above the lowest boards.
};
/// `width` along x, kBookcaseDepth deep.
Bookcase build_bookcase(double width, double room_height, const RoomMaterials& materials, Rng rng);

}  // namespace diorama::dining_room
