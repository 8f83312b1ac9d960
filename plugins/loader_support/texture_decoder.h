// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"

namespace diorama::loader_support {

/// Decodes the pictures of one asset: each once, several at a time, and hands them out in the
/// colour space that an input of a material needs.
class TextureDecoder {
 public:
  /// Gives a decoded picture or throws Error; called from any thread.
  using Decode = std::function<std::shared_ptr<const Texture>()>;

  explicit TextureDecoder(Host& host) : host_(host) {}

  /// Announces a picture. The first announcement of an identifier counts.
  void announce(const std::string& identifier, Decode decode);

  /// Decodes on all threads what was announced and is not decoded yet.
  void decode_announced();

  /// The picture, which must have been announced. Without a space the one that the file's kind
  /// suggests; floating-point pictures are linear whatever is asked for. Throws what decoding
  /// threw.
  std::shared_ptr<const Texture> get(const std::string& identifier,
                                     std::optional<ColorSpace> space);

 private:
  struct Picture {
    Decode decode;
    std::shared_ptr<const Texture> texture;
    std::exception_ptr error;
    bool is_decoded = false;
  };
  static void decode(Picture& picture);

  Host& host_;
  std::map<std::string, Picture> pictures_;
  std::map<std::pair<std::string, ColorSpace>, std::shared_ptr<const Texture>> converted_;
};

}  // namespace diorama::loader_support
