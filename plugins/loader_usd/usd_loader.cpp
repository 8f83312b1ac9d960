// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/usd_loader.h"

#include <algorithm>
#include <set>

#include "diorama/error.h"
#include "loader_usd/scene_translator.h"
#include "loader_usd/texture_library.h"
#include "loader_usd/usd/error.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {
namespace {

/// The layers and other assets that a file leads to.
class FileCollector {
 public:
  void add_layer(const std::string& identifier) {
    if (!add(identifier)) return;
    std::shared_ptr<const usd::Layer> layer;
    try {
      layer = library_.open(identifier);
    } catch (const usd::FormatError&) {
      if (files_.size() == 1) throw;
      return;  // load() warns of it
    }
    const usd::Layer::NamedAssets named = layer->named_assets();
    for (const std::string& name : named.layers) {
      add_layer(library_.anchor(name, layer->identifier()));
    }
    for (const std::string& name : named.values) {
      for (const std::string& file : tile_names(library_.anchor(name, layer->identifier()))) {
        add(file);
      }
    }
  }
  const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  /// False when it is known or missing.
  bool add(const std::string& identifier) {
    if (identifier.empty() || !known_.insert(identifier).second) return false;
    if (!library_.exists(identifier)) return false;
    const std::filesystem::path file = identifier.substr(0, identifier.find('['));
    if (std::ranges::find(files_, file) == files_.end()) files_.push_back(file);
    return true;
  }

  usd::AssetLibrary library_;
  std::set<std::string> known_;
  std::vector<std::filesystem::path> files_;
};
}  // namespace

std::vector<std::string> UsdLoader::claims() const {
  return {".usd", ".usda", ".usdc", ".usdz", "=PXR-USDC", "=#usda", "=#sdf", "=PK"};
}

std::vector<std::filesystem::path> UsdLoader::files(std::string_view asset) const {
  try {
    FileCollector collector;
    collector.add_layer(std::string(asset));
    return collector.files();
  } catch (const usd::FormatError& error) {
    throw Error(ErrorKind::Asset, error.what());
  }
}

void UsdLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  try {
    usd::Stage stage(std::string(asset), usd::Sampling::OrFirstSample,
                     std::uint64_t(params_.max_prims_mib) << 20);
    SceneTranslator translator(stage, host_, scene);
    host_.log(LogLevel::Debug, translator.describe_units());
    translator.translate(root);
    const auto& missing = stage.diagnostics().missing_assets();
    if (params_.missing_assets_are_errors && !missing.empty()) {
      throw Error(ErrorKind::Asset, std::string(asset) + ": " + missing.front());
    }
    for (const std::string& warning : stage.warnings()) host_.log(LogLevel::Warning, warning);
  } catch (const usd::FormatError& error) {
    const std::string text = error.what();
    const std::string name(asset);
    throw Error(ErrorKind::Asset, text.starts_with(name) ? text : name + ": " + text);
  }
}

}  // namespace diorama::loader_usd
