// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/scene.h"
#include "framework/export/material_export.h"
#include "framework/export/usd_layer.h"

namespace diorama::usd_export {

struct SceneLayer {
  Layer layer;
  std::vector<TextureFile> textures;
};

/// Everything at and below `root` as "/World", z up and in metres: transforms, meshes with their
/// material subsets, lights, cameras, labels and, if wanted, rigid bodies, colliders and joints.
/// `stem` is the name of the file without folder and ending; pictures are called after it.
SceneLayer scene_layer(const Scene& scene, NodeId root, const std::string& stem, bool with_physics);

}  // namespace diorama::usd_export
