// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/params.h"

namespace diorama::loader_urdf {

/// Loads URDF models: a node per link, side by side below the asset's node, with its shapes and
/// meshes, and a node per joint below `joints`, all joints at position 0. Meshes are loaded by the
/// host's other loaders.
class UrdfLoader final : public Loader {
 public:
  struct Params {
    std::vector<std::string> packages;
    bool missing_assets_are_errors = false;
    void visit(ParamVisitor& v);
  };

  UrdfLoader(Params params, Host& host) : params_(std::move(params)), host_(host) {}

  std::vector<std::string> claims() const override { return {".urdf"}; }
  std::vector<std::filesystem::path> files(std::string_view asset) const override;
  void load(std::string_view asset, Scene& scene, NodeId root) override;

 private:
  Params params_;
  Host& host_;
};

}  // namespace diorama::loader_urdf
