// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "diorama/host.h"
#include "diorama/scene.h"

namespace diorama::dining_room {

/// Fills `root` with a furnished room; its floor is at z = 0 and it stands some metres off the
/// origin. Same seed, same room.
void build_dining_room(std::uint64_t seed, Host& host, Scene& scene, NodeId root);

}  // namespace diorama::dining_room
