// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "layer.h"
#include "mapped_file.h"
#include "package.h"

namespace diorama::usd {

/// Finds and opens assets: files, and members of packages (`/a/b.usdz[c/d.png]`, also nested).
/// Layers are opened once. Not thread safe.
class AssetLibrary {
 public:
  /// What somebody else knows of an asset that is not where its layer says: a server's file.
  struct Lookup {
    std::string file;     ///< Empty: it is nowhere.
    std::string why_not;  ///< For people, after a colon; may be empty.
  };
  using LookUp = std::function<Lookup(const std::string& asset)>;

  explicit AssetLibrary(LookUp look_up = {}) : look_up_(std::move(look_up)) {}

  /// The identifier that `asset` has for the layer `anchor`, whether it exists or not: paths are
  /// relative to that layer; inside of a package they stay in it. What is not there and was not
  /// said to be beside the layer ("./", "../") is looked up.
  std::string anchor(std::string_view asset, const std::string& anchor_layer) const;

  /// For people, about an identifier that does not exist: "could not be found".
  std::string missing_text(const std::string& identifier) const;

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
  std::string anchor_to_layer(const std::string& asset, const std::string& anchor_layer) const;
  std::shared_ptr<const Layer> read_layer(const std::string& identifier) const;
  std::shared_ptr<const Package> package(const std::string& identifier) const;

  struct Opened {
    std::shared_ptr<const Layer> layer;
    std::string error;
  };
  LookUp look_up_;
  mutable std::map<std::string, Lookup> looked_up_;  ///< By identifier.
  std::map<std::string, Opened> layers_;
  mutable std::uint64_t layer_bytes_ = 0;
  mutable std::map<std::string, std::shared_ptr<const Package>> packages_;
  mutable std::vector<ByteView> mapped_files_;
};

/// What a set of UDIM tiles, "wood.<UDIM>.png", can have as files; other names stand by themselves.
std::vector<std::string> tile_names(const std::string& identifier);

/// Reads a layer from bytes in memory: text or crate, whatever they are. Throws FormatError.
std::shared_ptr<Layer> read_layer(const std::string& identifier, ByteView bytes);

}  // namespace diorama::usd
