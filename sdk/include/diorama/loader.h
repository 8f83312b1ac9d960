// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/component.h"
#include "diorama/scene.h"

namespace diorama {

/// Puts environments and assets into a scene. An asset is named by a file path or by
/// "scheme:rest" ("dining_room:7", "shape:cube"). Called by one thread at a time.
class DIORAMA_SDK_API Loader : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Loader;

  ~Loader() override;

  /// In lower case endings ".usd", schemes "shelf:"; how files without an ending begin, "=#usda".
  virtual std::vector<std::string> claims() const = 0;

  /// The assets that its parameters name when it stands in a job's `environments` or `objects`
  /// list, in order: file paths or "scheme:rest". Loaders that only serve files return none.
  virtual std::vector<std::string> assets() const;

  /// The files that `asset` consists of as far as they are there, itself first: layers, textures,
  /// material libraries. As long as a loader does not say otherwise it is the file alone, or
  /// nothing for a scheme. Throws Error(Asset) when the asset cannot be read.
  virtual std::vector<std::filesystem::path> files(std::string_view asset) const;

  /// Fills the empty node `root` (pose, mesh, children ...) in metres, Z up. `asset` is a path that
  /// exists or one of its own schemes; the variants of a file may follow it, "mug.usd{look=red}",
  /// and the second at which it is taken, "walker.usd{time=1.5}", for loaders that know such.
  /// Throws Error(Asset) that begins with the asset's name; what it added so far is then erased by
  /// the host. Same asset and parameters, same result.
  virtual void load(std::string_view asset, Scene& scene, NodeId root) = 0;
};

}  // namespace diorama
