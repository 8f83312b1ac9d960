// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "asset_library.h"
#include "layer.h"

namespace diorama::usd {

/// Says once what a user should know: an asset that is missing, an arc that goes in a circle.
class Diagnostics {
 public:
  void warn(const std::string& text);
  /// The same for an asset that cannot be found or read: what names it first is told, and how many
  /// others do.
  void missing(const std::string& asset, const std::string& text);
  const std::vector<std::string>& warnings() const { return warnings_; }
  struct MissingAsset {
    std::string asset;
    std::string text;  ///< One of the warnings.
  };
  const std::vector<MissingAsset>& missing_assets() const { return missing_; }

 private:
  std::vector<std::string> warnings_;
  std::vector<MissingAsset> missing_;
  std::set<std::string> known_;
  struct Missing {
    std::size_t warning = 0;  ///< Index.
    std::size_t place = 0;    ///< Among missing_.
    std::string text;
    int others = 0;
  };
  std::map<std::string, Missing> by_asset_;
};

/// A layer and its sublayers, strongest first.
struct LayerStack {
  struct Entry {
    std::shared_ptr<const Layer> layer;
    LayerOffset offset;  ///< From the layer's time to the time of the root layer.
  };
  std::vector<Entry> layers;
  Dictionary expression_variables;
  double time_codes_per_second = 24.0;
  /// Source to target and back; from all layers, the strongest opinion about a source counts.
  std::map<std::string, std::string, std::less<>> relocate_targets;
  std::map<std::string, std::string, std::less<>> relocate_sources;

  const Layer& root() const { return *layers.front().layer; }
  bool has_prim(std::string_view path) const;
};

/// Where an arc of a composed list came from.
struct ComposedReference {
  Reference reference;   ///< The asset is anchored, the offset includes the sublayer's.
  std::string authored;  ///< The asset as written.
  const Layer* source = nullptr;
};

/// Opens layer stacks, each once for the variables it is seen with.
class LayerStacks {
 public:
  LayerStacks(AssetLibrary& assets, Diagnostics& diagnostics)
      : assets_(assets), diagnostics_(diagnostics) {}

  /// `outer_variables` win over the layer's own. Throws FormatError when the root layer cannot be
  /// read; sublayers that cannot are warned about and left out.
  const LayerStack& open(const std::string& identifier, const Dictionary& outer_variables);

  const AssetLibrary& assets() const { return assets_; }
  Diagnostics& diagnostics() { return diagnostics_; }

  /// Anchors the asset path, or what its expression evaluates to, to the layer that says it.
  std::string anchor(const std::string& asset, const Layer& layer,
                     const Dictionary& variables) const;
  /// The text, or what its expression evaluates to; empty with a warning if it cannot be evaluated.
  std::string evaluate(const std::string& text, const Layer& layer,
                       const Dictionary& variables) const;

 private:
  void add_layer(LayerStack& stack, std::shared_ptr<const Layer> layer, LayerOffset offset,
                 std::vector<std::string>& chain);
  void collect_relocates(LayerStack& stack);

  AssetLibrary& assets_;
  Diagnostics& diagnostics_;
  std::map<std::string, std::unique_ptr<const LayerStack>> stacks_;
};

/// Time codes per second of one layer; frames per second stand in where it says nothing.
double time_codes_per_second(const Layer& layer);

/// Composes the opinions that the layers of a stack have about one prim, weakest first.
Strings compose_strings(const LayerStack& stack, std::string_view path, std::string_view field);
std::vector<ComposedReference> compose_references(const LayerStacks& stacks,
                                                  const LayerStack& stack, std::string_view path,
                                                  std::string_view field);

}  // namespace diorama::usd
