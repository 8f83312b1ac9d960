// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/camera.h"
#include "diorama/math.h"
#include "loader_assimp/scene_file.h"

namespace diorama::loader_assimp {

struct TranslatedCamera {
  Camera camera;
  /// From camera space to the node's.
  Affine node_from_camera = Affine::Identity();
};

/// `metres_per_unit`: size of one unit of the node's space.
TranslatedCamera translate_camera(const aiCamera& source, Format format, double metres_per_unit);

}  // namespace diorama::loader_assimp
