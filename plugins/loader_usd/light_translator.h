// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/geometry.h"
#include "diorama/light.h"
#include "diorama/material.h"
#include "loader_usd/texture_library.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

struct TranslatedLight {
  Light light;
  /// From the light's axes to the prim's, in which USD describes it.
  Affine prim_from_light = Affine::Identity();
  /// What a scene's light cannot hold: "inputs:diffuse is not taken".
  std::vector<std::string> losses;
};

/// Makes a light out of a UsdLux prim. `world_scale`: mean factor by which the prim's transforms
/// enlarge, in stage units, for lights that are normalised by their area. Nothing for prims that
/// are no lights. Cylinder lights become spheres of the same area.
std::optional<TranslatedLight> translate_light(const usd::Stage& stage, const usd::Prim& prim,
                                               double world_scale, TextureLibrary& textures);

/// A mesh that shines (MeshLightAPI).
struct MeshLight {
  Vec3f emission;         ///< Radiance.
  std::string sync_mode;  ///< What its material has to do with it: `light:materialSyncMode`.
  std::vector<std::string> losses;
};

/// `world_scale` as above.
MeshLight translate_mesh_light(const usd::Stage& stage, const usd::Prim& prim, const Mesh& mesh,
                               double world_scale);

/// The material of a mesh that shines. What a material glows by itself is tinted by the light, as
/// is the API's default; one that does not glow shines in the light's colour.
Material shining_material(const Material& material, const MeshLight& light);

}  // namespace diorama::loader_usd
