// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/scene.h"
#include "loader_usd/usd_loader.h"
#include "support/texture_host.h"

namespace diorama::test {

/// A stage in a scene of its own, below /asset.
struct LoadedStage {
  Scene scene;
  NodeId root;
  TextureHost host;

  explicit LoadedStage(const std::string& file, loader_usd::UsdLoader::Params params = {}) {
    root = scene.create(scene.root(), "asset");
    loader_usd::UsdLoader(params, host).load(file, scene, root);
  }
  const Node& node(const std::string& path) { return scene[scene.require("/asset/" + path)]; }
};

}  // namespace diorama::test
