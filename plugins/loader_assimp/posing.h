// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <assimp/scene.h>

#include <string>

namespace diorama::loader_assimp {

/// The animation of a file that a word means: its name, or its number from 0 on. Throws
/// Error(Asset) that begins with `asset` and says which there are.
unsigned find_animation(const aiScene& scene, const std::string& word, const std::string& asset);

/// Seconds that an animation lasts; 0 when there is none, or nothing moves in it.
double animation_seconds(const aiScene& scene, unsigned animation);

/// "animation 2 'run' lasts 0.8 s"
std::string describe_animation(const aiScene& scene, unsigned animation);

/// Puts nodes where an animation has them at a time, between keys on the straight way, and weights
/// of morph targets likewise into aiAnimMesh::mWeight. What is no number changes nothing.
void pose_at(aiScene& scene, unsigned animation, double seconds);

}  // namespace diorama::loader_assimp
