// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"
#include "loader_assimp/scene_file.h"
#include "loader_support/missing_pictures.h"
#include "loader_support/texture_decoder.h"

namespace diorama::loader_assimp {

/// The picture that a material of a file in `folder` names: where it says, or beside the file.
std::optional<std::filesystem::path> find_picture(const std::filesystem::path& folder,
                                                  const std::string& name);

/// The textures of a file: pictures inside of it (packed or raw) and beside it.
class TextureLibrary {
 public:
  TextureLibrary(const SceneFile& file, Host& host) : file_(file), host_(host), decoder_(host) {}

  /// Announces a picture, as a material names it; decode_announced() then reads all of them at
  /// once.
  void announce(const std::string& name) { identify(name); }
  void decode_announced() { decoder_.decode_announced(); }

  /// Null when there is no such picture or it cannot be read; missing() then has a line for it.
  /// `material` is the name of the material that wants it.
  std::shared_ptr<const Texture> read(const std::string& name, ColorSpace space,
                                      const std::string& material);

  /// One line per missing picture; it names the file, the picture and its materials.
  std::vector<std::string> missing() const { return missing_.lines(); }

 private:
  /// The picture's name for the decoder, which knows it then; empty when there is none.
  std::string identify(const std::string& name);
  void report(const std::string& name, const std::string& why, const std::string& material);

  const SceneFile& file_;
  Host& host_;
  loader_support::TextureDecoder decoder_;
  loader_support::MissingPictures missing_;
};

}  // namespace diorama::loader_assimp
