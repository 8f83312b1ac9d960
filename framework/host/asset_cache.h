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

/// Assets that were loaded before, each in a scene of its own, up to a number of bytes; the longest
/// unused go first. An asset that alone exceeds the budget is not kept. Main thread only.
class AssetCache {
 public:
  explicit AssetCache(std::size_t budget_bytes);

  /// The private scene of an asset; `load` fills it on a miss. What is copied out of it shares
  /// meshes, materials and textures.
  std::shared_ptr<const Scene> get(const std::string& key,
                                   const std::function<void(Scene&)>& load);

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

/// Memory that meshes, materials and textures of a scene hold, shared ones counted once.
std::size_t scene_bytes(const Scene& scene);

/// Copies everything below `from`'s root to below `parent`, which gets one new child named `stem`
/// carrying what the root of `from`'s only child carries. Returns the new child.
NodeId instantiate(const Scene& from, NodeId source, Scene& to, NodeId parent,
                   std::string_view stem);

}  // namespace diorama
