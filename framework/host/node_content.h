// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/scene.h"

namespace diorama {

/// Copies what a node holds: visibility, labels, mesh, materials, light, camera, collider and body,
/// but neither its name nor its place in the tree or in space. Shared data stays shared.
void copy_content(const Node& from, Node& to);

}  // namespace diorama
