// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <assimp/scene.h>

#include <optional>

namespace diorama::loader_assimp {

/// Seconds that the first animation of a file lasts; nothing when it has none.
std::optional<double> animation_seconds(const aiScene& scene);

/// Puts nodes where the first animation has them at a time, between keys on the straight way, and
/// weights of morph targets likewise into aiAnimMesh::mWeight. What is no number changes nothing.
void pose_at(aiScene& scene, double seconds);

}  // namespace diorama::loader_assimp
