// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"
#include "loader_assimp/scene_file.h"
#include "loader_support/texture_decoder.h"

namespace diorama::loader_assimp {

/// The textures of a file: pictures inside of it (packed or raw) and beside it.
class TextureLibrary {
 public:
  TextureLibrary(const SceneFile& file, Host& host) : file_(file), host_(host), decoder_(host) {}

  /// Announces a picture, as a material names it; decode_announced() then reads all of them at
  /// once.
  void announce(const std::string& name) { identify(name); }
  void decode_announced() { decoder_.decode_announced(); }

  /// Null when there is no such picture or it cannot be read; missing() then has a line for it.
  std::shared_ptr<const Texture> read(const std::string& name, ColorSpace space);

  /// One line per missing picture; it names the file and the picture.
  const std::vector<std::string>& missing() const { return missing_; }

 private:
  /// The picture's name for the decoder, which knows it then; empty when there is none.
  std::string identify(const std::string& name);
  void report(const std::string& name, const std::string& why);

  const SceneFile& file_;
  Host& host_;
  loader_support::TextureDecoder decoder_;
  std::set<std::string> reported_;
  std::vector<std::string> missing_;
};

}  // namespace diorama::loader_assimp
