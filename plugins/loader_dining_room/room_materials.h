// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "modelling/surfaces.h"

namespace diorama::dining_room {

/// A material and how often its texture repeats per metre.
struct Finish {
  modelling::MaterialPtr material;
  double repeats_per_m = 1.0;
};

/// What a room is made of. Chosen together, so that things go with each other.
struct RoomMaterials {
  Finish wall, ceiling, floor, trim, exterior;
  Finish window_frame;
  Finish table_wood, cabinet_wood, shelf_wood, door_wood;
  Finish leg_metal;  ///< Dark or bright metal of legs and stands.
  Finish brass;      ///< Handles, rods, knobs.
  Finish seat_fabric, curtain, lampshade, shell;
  Finish counter;  ///< Top of the sideboard: wood or marble.
  Finish porcelain, earthenware, glass, pane, frosted, steel;
  Finish paper, soil, leaf, wax, fruit_a, fruit_b;
};

RoomMaterials choose_materials(Rng rng, Host& host);

}  // namespace diorama::dining_room
