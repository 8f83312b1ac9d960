// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <functional>
#include <string>

#include "diorama/error.h"
#include "diorama/host.h"
#include "loader_support/asset_name.h"

namespace diorama::loader_assimp {

enum class Format {
  Gltf,
  Fbx,
  Collada,
  ThreeMf,
  Plain,  ///< OBJ, PLY, STL, OFF: neither units nor axes are stated.
  Other,
};

/// Runs `body`, which reads `file` with assimp, in a child process whose time and memory are
/// limited by the file's size. Returns what it returned, or what it died of.
std::string read_in_child(const std::string& file, const std::function<std::string()>& body);

/// "FILE: assimp cannot read it: WHY".
Error unreadable(const std::string& file, const std::string& why);

/// A file as assimp reads it: triangles only, and its nodes where one of its animations has them at
/// a time, or at rest.
class SceneFile {
 public:
  /// Some files make assimp crash, hang or take all memory. So the file is read in a child process
  /// first, whose time and memory are limited, and here only when that went well. Throws
  /// Error(Asset) that begins with the file's name. What assimp complains about and survives
  /// becomes a warning.
  SceneFile(const loader_support::TimedAsset& asset, Host& host);

  const std::string& name() const { return name_; }
  Format format() const { return format_; }
  const aiScene& scene() const { return *importer_.GetScene(); }
  /// The one that was asked for, or the first.
  unsigned animation() const { return animation_; }

 private:
  std::string name_;
  Format format_;
  unsigned animation_ = 0;
  Assimp::Importer importer_;
};

}  // namespace diorama::loader_assimp
