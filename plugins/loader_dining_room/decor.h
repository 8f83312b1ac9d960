// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "loader_dining_room/piece.h"
#include "loader_dining_room/room_materials.h"

/// Small things. Each stands on z = 0 about the z axis unless said otherwise.
namespace diorama::dining_room {

Piece build_rug(const Vec2& size, double thickness, bool is_round, Host& host, Rng rng);

Piece build_plate(const RoomMaterials& materials, Rng rng);
Piece build_bowl(const RoomMaterials& materials, Rng rng);
Piece build_fruit_bowl(const RoomMaterials& materials, Rng rng);
Piece build_wineglass(const RoomMaterials& materials, Rng rng);
Piece build_cup(const RoomMaterials& materials, Rng rng);
Piece build_vase(const RoomMaterials& materials, Rng rng);
Piece build_candlestick(const RoomMaterials& materials, Rng rng);
/// Handle towards -y; lies on z = 0.
enum class Cutlery { Fork, Knife, Spoon };
Piece build_cutlery(Cutlery kind, const RoomMaterials& materials);
/// A pot with a plant, about `height` tall.
Piece build_plant(double height, const RoomMaterials& materials, Rng rng);
/// Upright books side by side from x = 0 to at most `width`, backs of the books at y = 0, spines
/// towards -y.
Piece build_books(double width, double max_height, double depth, const RoomMaterials& materials,
                  const modelling::MaterialPtr& spines, Rng rng);
/// Books lying on each other.
Piece build_book_stack(const RoomMaterials& materials, const modelling::MaterialPtr& spines,
                       Rng rng);
constexpr int kSpinesPerTexture = 16;

/// A framed picture, its back at y = 0, looking along -y, its middle at the origin.
Piece build_picture(double width, double height, const RoomMaterials& materials, Host& host,
                    Rng rng);

/// A lamp below the ceiling: z = 0 is the ceiling.
struct CeilingLight {
  Piece body;
  Piece glass;  ///< Around the bulb; named so that light rules hide it.
  Vec3 bulb = Vec3::Zero();
  double bulb_radius = 0.03;
  double lumens = 800;
  double kelvin = 3000;
};
CeilingLight build_ceiling_light(const RoomMaterials& materials, Rng rng);
/// A lamp for the sideboard; z = 0 is its foot.
CeilingLight build_table_lamp(const RoomMaterials& materials, Rng rng);

/// Colour of a black body, linear, with luminance 1 (fit of Krystek 1985 to the Planckian locus).
Vec3f black_body_color(double kelvin);

}  // namespace diorama::dining_room
