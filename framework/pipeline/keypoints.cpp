// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/keypoints.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "diorama/error.h"
#include "diorama/params.h"
#include "framework/config/yaml_config.h"
#include "framework/host/asset_paths.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// `keypoints: {tip: [0.1, 0, 0.02]}`, metres in the space of the asset's own node.
std::vector<Keypoint> read_keypoints(const fs::path& file) {
  const Value all = read_job_file(file);
  Diagnostics diagnostics;
  std::vector<Keypoint> points;
  const Value* map = all.find("keypoints");
  if (!map || map->kind != Value::Kind::Map || all.map.size() != 1) {
    diagnostics.add(all.place, "expected 'keypoints: {tip: [0.1, 0, 0.02]}' and nothing else");
  } else {
    ParamReader reader(*map, "keypoints", diagnostics);
    for (const auto& [name, value] : map->map) {
      points.push_back({name, Vec3::Zero()});
      reader.param(name.c_str(), points.back().position, {"Its place.", "m", -1e4, 1e4});
    }
    reader.finish();
  }
  diagnostics.raise();
  return points;
}

std::string list_of(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

}  // namespace

void keep_keypoints(Scene& scene, NodeId object, NodeId root, const std::string& asset,
                    const std::vector<std::string>& wanted) {
  if (!wanted.empty()) {
    const fs::path file = keypoints_file(asset);
    std::error_code error;
    if (!file.empty() && fs::is_regular_file(file, error)) {
      std::vector<Keypoint> points = read_keypoints(file);
      auto& own = scene.edit(root).keypoints;
      points.insert(points.end(), own.begin(), own.end());
      own = std::move(points);
    }
  }
  std::vector<std::string> found;
  bool has_some = false;
  for (const NodeId node : scene.subtree(object)) {
    if (scene[node].keypoints.empty()) continue;
    for (const Keypoint& point : scene[node].keypoints) {
      if (std::ranges::find(found, point.name) == found.end()) found.push_back(point.name);
    }
    auto& points = scene.edit(node).keypoints;
    std::erase_if(points, [&](const Keypoint& point) {
      return std::ranges::find(wanted, point.name) == wanted.end();
    });
    has_some |= !points.empty();
  }
  if (wanted.empty() || has_some) return;
  const fs::path file = keypoints_file(asset);
  throw Error(
      ErrorKind::Asset,
      asset + ": has no keypoint " + list_of(wanted) +
          (found.empty() ? ", nor any other" : ", only " + list_of(found)) +
          (file.empty() ? "" : "; they are looked for in the file and in " + file.string()));
}

}  // namespace diorama
