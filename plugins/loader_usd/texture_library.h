// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "diorama/host.h"
#include "diorama/material.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// How the colours of a texture file are to be read.
enum class TextureSpace { Auto, Raw, Srgb };

/// Reads each texture once, from files and from packages. What cannot be read is reported once,
/// with the layer that names it.
class TextureLibrary {
 public:
  TextureLibrary(usd::Stage& stage, Host& host) : stage_(stage), host_(host) {}

  /// Null when the attribute has no asset or the asset cannot be read. Of a set of UDIM tiles the
  /// first one is taken.
  std::shared_ptr<const Texture> read(const usd::FoundValue& asset, TextureSpace space);

 private:
  std::shared_ptr<const Texture> decode(const std::string& identifier);

  usd::Stage& stage_;
  Host& host_;
  std::map<std::string, std::shared_ptr<const Texture>> decoded_;
  std::map<std::pair<std::string, ColorSpace>, std::shared_ptr<const Texture>> converted_;
};

}  // namespace diorama::loader_usd
