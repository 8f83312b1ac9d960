// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/scene.h"
#include "loader_assimp/assimp_loader.h"
#include "support/render_host/render_host.h"

namespace diorama::test {

/// A file in a scene of its own, below /asset.
struct LoadedFile {
  RenderHost host{2};
  Scene scene;
  NodeId root;

  explicit LoadedFile(const std::string& file, loader_assimp::AssimpLoader::Params params = {}) {
    root = scene.create(scene.root(), "asset");
    loader_assimp::AssimpLoader(params, host).load(file, scene, root);
  }
  NodeId id(const std::string& path) const { return scene.require("/asset/" + path); }
  const Node& node(const std::string& path) const { return scene[id(path)]; }
  Aabb bounds() const { return scene.world_bounds(root); }
};

/// A picture of two pixels, red on the left and green on the right.
std::string red_green_png();
std::string base64(const std::string& bytes);

/// The numbers as bytes, one after the other.
template <class T>
std::string bytes_of(const std::vector<T>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)};
}

}  // namespace diorama::test
