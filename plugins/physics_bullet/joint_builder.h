// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "body_builder.h"
#include "diorama/scene.h"

namespace diorama {

/// Fills Bodies::joints from the scene: of joints whose bodies move as two, or of which one moves.
/// What a body is held to while it stands still does not collide with it.
void add_joints(const Scene& scene, Bodies& bodies);

/// Sets the motors of joints that mimic others so that they are where they belong after a step of
/// the engine of that length.
void drive_followers(Bodies& bodies, double seconds);

}  // namespace diorama
