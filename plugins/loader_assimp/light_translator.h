// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "diorama/light.h"
#include "diorama/math.h"
#include "loader_assimp/scene_file.h"

namespace diorama::loader_assimp {

struct TranslatedLight {
  Light light;
  /// From the light's axes (shining along -z) to those of its node.
  Affine node_from_light = Affine::Identity();
};

/// Nothing for lights that give no light or that assimp cannot describe. glTF's candela and lux
/// become watts by 683 lumens per watt; the numbers of other formats, which have no unit, are taken
/// as W/sr and W/m^2. Lights without a size become small spheres. `metres_per_unit`: size of one
/// unit of the node's space.
std::optional<TranslatedLight> translate_light(const aiLight& source, Format format,
                                               double metres_per_unit);

}  // namespace diorama::loader_assimp
