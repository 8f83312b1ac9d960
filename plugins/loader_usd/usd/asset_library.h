// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "layer.h"
#include "mapped_file.h"
#include "package.h"

namespace diorama::usd {

/// Finds and opens assets: files, and members of packages (`/a/b.usdz[c/d.png]`, also nested).
/// Layers are opened once. Not thread safe.
class AssetLibrary {
 public:
  /// The identifier that `asset` has for the layer `anchor`, whether it exists or not: paths are
  /// relative to that layer; inside of a package they stay in it.
  std::string anchor(std::string_view asset, const std::string& anchor_layer) const;

  bool exists(const std::string& identifier) const;

  /// The bytes of a file or package member. Throws FormatError.
  ByteView read(const std::string& identifier) const;

  /// Gives back the memory that reading files took so far. Values stay valid: what they hold is
  /// read again when it is looked at.
  void release_pages() const;

  /// Opens a layer, or the root layer of a package. Throws FormatError, the same again when asked
  /// again.
  std::shared_ptr<const Layer> open(const std::string& identifier);

  /// What the layers that were opened so far take on disk.
  std::uint64_t layer_bytes() const { return layer_bytes_; }

 private:
  std::shared_ptr<const Layer> read_layer(const std::string& identifier) const;
  std::shared_ptr<const Package> package(const std::string& identifier) const;

  struct Opened {
    std::shared_ptr<const Layer> layer;
    std::string error;
  };
  std::map<std::string, Opened> layers_;
  mutable std::uint64_t layer_bytes_ = 0;
  mutable std::map<std::string, std::shared_ptr<const Package>> packages_;
  mutable std::vector<ByteView> mapped_files_;
};

/// Reads a layer from bytes in memory: text or crate, whatever they are. Throws FormatError.
std::shared_ptr<Layer> read_layer(const std::string& identifier, ByteView bytes);

}  // namespace diorama::usd
