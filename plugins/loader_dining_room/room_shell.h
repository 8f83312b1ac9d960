// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/scene.h"
#include "loader_dining_room/room_materials.h"
#include "loader_dining_room/room_plan.h"

namespace diorama::dining_room {

/// Floor, walls, ceiling, skirting boards, windows with curtains, the door. Seeds of names come
/// from `rng`.
void build_shell(const RoomPlan& plan, const RoomMaterials& materials, const Rng& rng, Scene& scene,
                 NodeId parent, const Affine& parent_from_room);

}  // namespace diorama::dining_room
