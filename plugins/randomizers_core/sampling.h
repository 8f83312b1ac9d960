// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "diorama/config.h"
#include "diorama/rng.h"
#include "diorama/scene.h"

namespace diorama {

/// Draws each axis in turn between the corners.
Vec3 draw_between(const Vec3& min, const Vec3& max, Rng& rng);
double draw_in(const Range& range, Rng& rng);

/// Throws Error(Config) "MIN_KEY must not exceed MAX_KEY: ..." when an axis is reversed.
void check_corners(const Vec3& min, const Vec3& max, std::string_view min_key,
                   std::string_view max_key);

/// Sets the node's pose from one in the world, whatever its ancestors' poses are.
void set_world_pose(Scene& scene, NodeId node, const Affine& world_from_node);

}  // namespace diorama
