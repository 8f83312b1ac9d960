// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/usd_loader.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

#include "diorama/error.h"
#include "loader_support/asset_name.h"
#include "loader_usd/scene_translator.h"
#include "loader_usd/texture_library.h"
#include "loader_usd/usd/error.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {
namespace {

/// Files of servers, and of disks of others, as far as the host has them below its assets root.
usd::AssetLibrary::LookUp look_up_by(const Host& host) {
  return [&host](const std::string& asset) {
    const bool is_url = asset.find("://") != std::string::npos;
    const bool is_bare = !is_url && !asset.starts_with('/');
    usd::AssetLibrary::Lookup result;
    // Never beside whoever runs the program, nor below the root of all files.
    const std::string name = is_bare ? "/" + asset : asset;
    try {
      const std::filesystem::path file = host.resolve(name);
      std::error_code error;
      const bool is_found = std::filesystem::is_regular_file(file, error);
      if (is_found && !(is_bare && file == name)) result.file = file.generic_string();
    } catch (const Error& error) {
      const std::string text = error.what();
      if (is_url) result.why_not = text.substr(text.starts_with(name + ": ") ? name.size() + 2 : 0);
    }
    return result;
  };
}

/// A file, the variants that are chosen by set, and a time: "mug.usd{look=red}{time=1.5}".
struct NamedAsset {
  std::string file;
  std::map<std::string, std::string> variants;
  std::optional<double> seconds;  ///< "{time=1.5}"

  /// The name without a time.
  std::string timeless() const {
    std::string name = file;
    for (const auto& [set, variant] : variants) name += "{" + set + "=" + variant + "}";
    return name;
  }
  explicit NamedAsset(std::string_view name) {
    file = name;
    std::error_code error;
    if (!name.ends_with('}') || std::filesystem::exists(file, error)) return;
    const std::size_t slash = name.rfind('/');
    const std::size_t brace = name.find('{', slash == std::string_view::npos ? 0 : slash);
    if (brace == std::string_view::npos) return;
    file = name.substr(0, brace);
    for (std::string_view rest = name.substr(brace); !rest.empty();) {
      const std::size_t end = rest.find('}');
      const std::size_t equals = std::min(rest.find('='), end);
      if (!rest.starts_with('{') || end == std::string_view::npos || equals == end || equals == 1) {
        throw Error(ErrorKind::Asset, std::string(name) + ": found '" + std::string(rest) +
                                          "', expected variants as {set=variant}");
      }
      const std::string_view word = rest.substr(equals + 1, end - equals - 1);
      if (rest.substr(1, equals - 1) == "time") {
        seconds = loader_support::parse_time(word, name);
      } else {
        variants[std::string(rest.substr(1, equals - 1))] = word;
      }
      rest.remove_prefix(end + 1);
    }
  }
};

/// Throws unless the scene has what was chosen.
void check_variants(usd::Stage& stage, const NamedAsset& asset) {
  if (asset.variants.empty()) return;
  const auto known = stage.root_variants();
  std::string text;
  for (const auto& [set, names] : known) {
    text += (text.empty() ? "" : "; ") + set + ":";
    for (const std::string& name : names) text += " " + name;
  }
  for (const auto& [set, name] : asset.variants) {
    const auto found = known.find(set);
    if (found != known.end() && found->second.contains(name)) continue;
    throw Error(ErrorKind::Asset, asset.file + ": has no variant '" + name + "' of a set '" + set +
                                      "'; there " +
                                      (text.empty() ? "are none at its root prims" : "is " + text));
  }
}

/// The layers and other assets that a file leads to.
class FileCollector {
 public:
  explicit FileCollector(const Host& host) : library_(look_up_by(host)) {}

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
      for (const std::string& file : usd::tile_names(library_.anchor(name, layer->identifier()))) {
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
    FileCollector collector(host_);
    collector.add_layer(NamedAsset(asset).file);
    return collector.files();
  } catch (const usd::FormatError& error) {
    throw Error(ErrorKind::Asset, error.what());
  }
}

void UsdLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  const NamedAsset named(asset);
  try {
    usd::Stage stage(named.file, usd::Sampling::OrFirstSample,
                     std::uint64_t(params_.max_prims_mib) << 20, look_up_by(host_), named.variants,
                     named.seconds);
    check_variants(stage, named);
    SceneTranslator translator(stage, host_, scene);
    host_.log(LogLevel::Debug, translator.describe_units());
    translator.translate(root);
    const auto range = stage.animation();
    if (range && loader_support::is_time(range->first) && loader_support::is_time(range->second)) {
      scene.edit(root).animation = Animation{named.timeless(), range->first, range->second};
    }
    const auto& missing = stage.diagnostics().missing_assets();
    if (params_.missing_assets_are_errors && !missing.empty()) {
      throw Error(ErrorKind::Asset, std::string(asset) + ": " + missing.front().text);
    }
    const std::set<std::string> known = told_before(missing);
    for (const std::string& warning : stage.warnings()) {
      host_.log(known.contains(warning) ? LogLevel::Debug : LogLevel::Warning, warning);
    }
  } catch (const usd::FormatError& error) {
    const std::string text = error.what();
    throw Error(ErrorKind::Asset, text.starts_with(named.file) ? text : named.file + ": " + text);
  }
}

/// Warnings about assets that another scene was told to lack.
std::set<std::string> UsdLoader::told_before(
    const std::vector<usd::Diagnostics::MissingAsset>& missing) {
  const std::lock_guard lock(told_mutex_);
  std::set<std::string> known;
  for (const auto& [asset, text] : missing) {
    if (!told_.insert(asset).second) known.insert(text);
  }
  return known;
}

}  // namespace diorama::loader_usd
