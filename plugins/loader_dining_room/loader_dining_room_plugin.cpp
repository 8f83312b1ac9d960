// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "loader_dining_room/dining_room_loader.h"

DIORAMA_PLUGIN("loader_dining_room", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD_LOADER(diorama::dining_room::DiningRoomLoader, "dining_room",
                     "Furnishes dining rooms from a seed: dining_room:7.", "dining_room:");
}
