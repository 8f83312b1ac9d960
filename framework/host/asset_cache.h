// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "diorama/scene.h"

namespace diorama {

/// Assets that were loaded before, each below the root of a scene of its own, up to a number of
/// bytes; the longest unused go first. An asset that alone exceeds the budget is not kept. Used by
/// one thread at a time.
class AssetCache {
 public:
  explicit AssetCache(std::size_t budget_bytes);

  /// The private scene of an asset; `load` fills it on a miss.
  std::shared_ptr<const Scene> get(const std::string& key, const std::function<void(Scene&)>& load);

  std::size_t bytes() const { return bytes_; }
  std::size_t budget_bytes() const { return budget_bytes_; }

 private:
  struct Entry {
    std::shared_ptr<const Scene> scene;
    std::size_t bytes = 0;
    std::list<std::string>::iterator age;
  };
  void make_room();

  std::size_t budget_bytes_;
  std::size_t bytes_ = 0;
  std::map<std::string, Entry> entries_;
  std::list<std::string> by_age_;  // longest unused first
};

/// Memory that a scene holds: nodes, meshes, materials and textures, shared ones counted once.
std::size_t scene_bytes(const Scene& scene);

/// Copies `source` of `from` and all below it to a new child of `parent` called `stem`. Meshes,
/// materials and textures are shared, not copied. Returns the child.
NodeId instantiate(const Scene& from, NodeId source, Scene& to, NodeId parent,
                   std::string_view stem);

}  // namespace diorama
