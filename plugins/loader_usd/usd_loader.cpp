// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/usd_loader.h"

#include "diorama/error.h"
#include "loader_usd/scene_translator.h"
#include "loader_usd/usd/error.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

std::vector<std::string> UsdLoader::claims() const { return {".usd", ".usda", ".usdc", ".usdz"}; }

void UsdLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  try {
    usd::Stage stage(std::string(asset), usd::Sampling::OrFirstSample);
    SceneTranslator(stage, host_, scene).translate(root);
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
