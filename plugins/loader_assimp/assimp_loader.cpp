// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/assimp_loader.h"

#include <sstream>

#include "diorama/error.h"
#include "loader_assimp/asset_files.h"
#include "loader_assimp/posing.h"
#include "loader_assimp/scene_file.h"
#include "loader_assimp/scene_translator.h"
#include "loader_support/asset_name.h"

namespace diorama::loader_assimp {

void AssimpLoader::Params::visit(ParamVisitor& v) {
  static constexpr const char* kAxes[] = {"x", "y", "z"};
  v.param("missing_assets_are_errors", missing_assets_are_errors,
          {"Whether a missing texture ends the job instead of being warned about."});
  v.choice("up_axis", unstated.up_axis, kAxes,
           {"Axis that points up in files that do not say so (OBJ, PLY, STL, OFF)."});
  v.param("meters_per_unit", unstated.meters_per_unit,
          {"Length of one unit in files that do not say so (OBJ, PLY, STL, OFF).", "m", 1e-9, 1e9});
}

std::vector<std::string> AssimpLoader::claims() const {
  std::istringstream words(DIORAMA_ASSIMP_CLAIMS);
  std::vector<std::string> claims;
  for (std::string word; words >> word;) claims.push_back(word);
  return claims;
}

std::vector<std::filesystem::path> AssimpLoader::files(std::string_view asset) const {
  return files_of(loader_support::split_time(asset).file);
}

void AssimpLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  const loader_support::TimedAsset timed = loader_support::split_time(asset);
  const SceneFile file(timed, host_);
  host_.log(LogLevel::Debug, describe_units(file, params_.unstated));
  for (unsigned i = 0; i < file.scene().mNumAnimations; ++i) {
    host_.log(LogLevel::Debug, describe_animation(file.scene(), i));
  }
  SceneTranslator translator(file, params_.unstated, host_, scene);
  translator.translate(root);
  // One that was chosen may be a pose.
  const double length = animation_seconds(file.scene(), file.animation());
  if ((length > 0.0 || timed.animation) && loader_support::is_time(length)) {
    scene.edit(root).animation = Animation{timed.timeless(), 0.0, length};
  }
  const std::vector<std::string> missing = translator.missing();
  if (params_.missing_assets_are_errors && !missing.empty()) {
    throw Error(ErrorKind::Asset, missing.front());
  }
  for (const std::string& warning : missing) host_.log(LogLevel::Warning, warning);
}

}  // namespace diorama::loader_assimp
