// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "loader_samples/samples_loader.h"

namespace diorama::test {

/// The meshes of the sample pack's objects and props, each once, as scenes share what they load.
inline std::vector<std::shared_ptr<const Mesh>> sample_meshes(Host& host) {
  std::vector<std::shared_ptr<const Mesh>> meshes;
  for (const char* set : {"objects", "props"}) {
    samples::SamplesLoader loader({.set = set}, host);
    for (const std::string& asset : loader.assets()) {
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
