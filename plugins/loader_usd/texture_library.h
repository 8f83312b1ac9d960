// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"
#include "loader_support/missing_pictures.h"
#include "loader_support/texture_decoder.h"
#include "loader_usd/udim_atlas.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// How the colours of a texture file are to be read.
enum class TextureSpace { Auto, Raw, Srgb };

struct FoundTexture {
  std::shared_ptr<const Texture> texture;
  /// From mesh uv to that of the texture: other than the identity for sets of UDIM tiles.
  Eigen::Matrix<float, 2, 3> texture_from_uv = Eigen::Matrix<float, 2, 3>::Identity();
};

/// Reads each texture once, from files and from packages, several at a time. What cannot be read is
/// reported once, with the layer that names it and the materials that want it.
class TextureLibrary {
 public:
  TextureLibrary(usd::Stage& stage, Host& host) : stage_(stage), host_(host), decoder_(host) {}

  /// Whether the attribute names a picture that exists; it is then read by read_announced().
  bool announce(const usd::FoundValue& asset, const std::string& material);
  void read_announced() { decoder_.decode_announced(); }

  /// A null texture when the attribute names none or it cannot be read. `material` is its name;
  /// empty for a light.
  FoundTexture read(const usd::FoundValue& asset, TextureSpace space, const std::string& material);

  /// Tells the stage's diagnostics what was missing.
  void report_missing() const;

 private:
  /// A picture, or the tiles of a set of pictures.
  struct Picture {
    std::string identifier;
    std::optional<UdimRange> udim;
  };
  /// A name of a picture and why it is none; empty where there is one.
  struct Found {
    std::optional<Picture> picture;
    std::string why_not;
  };
  std::optional<Picture> find(const usd::FoundValue& asset, const std::string& material);
  std::optional<Picture> find_tiles(const std::string& identifier);
  void missing(const usd::FoundValue& asset, const std::string& why, const std::string& material);

  usd::Stage& stage_;
  Host& host_;
  loader_support::TextureDecoder decoder_;
  std::map<std::string, Found> found_;
  loader_support::MissingPictures missing_;
};

}  // namespace diorama::loader_usd
