// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "loader_samples/samples_loader.h"

namespace diorama::test {

/// The meshes of the sample pack's objects and props, each once, as scenes share what they load.
/// `left_out`: assets whose names hold one of these.
inline std::vector<std::shared_ptr<const Mesh>> sample_meshes(
    Host& host, std::span<const std::string_view> left_out = {}) {
  std::vector<std::shared_ptr<const Mesh>> meshes;
  for (const char* set : {"objects", "props"}) {
    samples::SamplesLoader loader({.set = set}, host);
    for (const std::string& asset : loader.assets()) {
      const auto is_named = [&](std::string_view name) {
        return asset.find(name) != std::string::npos;
      };
      if (std::ranges::any_of(left_out, is_named)) continue;
      Scene scene;
      const NodeId root = scene.create(scene.root(), "asset");
      loader.load(asset, scene, root);
      for (const NodeId id : scene.subtree(root)) {
        if (scene[id].mesh) meshes.push_back(scene[id].mesh);
      }
    }
  }
  return meshes;
}

}  // namespace diorama::test
