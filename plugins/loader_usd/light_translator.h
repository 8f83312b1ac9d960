// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "diorama/light.h"
#include "loader_usd/texture_library.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

struct TranslatedLight {
  Light light;
  /// From the light's axes to the prim's, in which USD describes it.
  Affine prim_from_light = Affine::Identity();
};

/// Makes a light out of a UsdLux prim. `world_scale`: mean factor by which the prim's transforms
/// enlarge, in stage units, for lights that are normalised by their area. Nothing for prims that
/// are no lights. Cylinder lights become spheres of the same area.
std::optional<TranslatedLight> translate_light(const usd::Stage& stage, const usd::Prim& prim,
                                               double world_scale, TextureLibrary& textures);

}  // namespace diorama::loader_usd
