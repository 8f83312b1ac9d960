// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/math.h"
#include "loader_assimp/scene_file.h"

namespace diorama::loader_assimp {

/// What holds for formats that state neither units nor axes.
struct UnstatedSpace {
  std::string up_axis = "z";  ///< x, y or z.
  double meters_per_unit = 1.0;
};

inline Vec3 to_vec3(const aiVector3D& v) { return {v.x, v.y, v.z}; }

Affine to_affine(const aiMatrix4x4& matrix);

/// From the space of the root node's children to metres and Z up, the root node's own pose
/// included. A file that says nonsense about its axes counts as Y up.
Affine metres_from_file(const SceneFile& file, const UnstatedSpace& unstated);

/// "units: 0.01 m, y up", as the file or its format says.
std::string describe_units(const SceneFile& file, const UnstatedSpace& unstated);

}  // namespace diorama::loader_assimp
