// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <assimp/scene.h>

#include <string>

namespace diorama::loader_assimp {

/// Puts nodes of a glTF file where one of its animations has them at a time, and sets the weights
/// of morph targets. assimp keeps neither steps nor tangents of splines nor weights below zero, so
/// that the file is read again; `scene` is what assimp made of it. Returns why what is left of the
/// animation could not be read, and stays as assimp has it; empty: all was.
std::string pose_gltf_at(aiScene& scene, const std::string& file, unsigned animation,
                         double seconds);

}  // namespace diorama::loader_assimp
