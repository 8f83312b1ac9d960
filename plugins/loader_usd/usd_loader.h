// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/params.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// Loads USD scenes: text, crate and packages, composed with all payloads and default variants, at
/// the default time or, where an attribute has time samples only, at the first one. Names may
/// choose variants of the root prims and a time in seconds: "mug.usd{look=red}{time=1.5}".
class UsdLoader final : public Loader {
 public:
  struct Params {
    bool missing_assets_are_errors = false;
    int max_prims_mib = int(usd::Stage::kComposedBytes >> 20);
    void visit(ParamVisitor& v) {
      v.param("missing_assets_are_errors", missing_assets_are_errors,
              {"Whether a missing layer or texture ends the job instead of being warned about."});
      v.param("max_prims_mib", max_prims_mib,
              {"Memory that composed prims may take, besides 64 times the size of the layers; "
               "references to references that multiply end there.",
               "MiB", 1, 1048576});
    }
  };

  UsdLoader(Params params, Host& host) : params_(params), host_(host) {}

  std::vector<std::string> claims() const override;
  /// Layers of all arcs, those of variants too, and what asset-valued attributes name.
  std::vector<std::filesystem::path> files(std::string_view asset) const override;
  void load(std::string_view asset, Scene& scene, NodeId root) override;

 private:
  std::set<std::string> told_before(const std::vector<usd::Diagnostics::MissingAsset>& missing);

  Params params_;
  Host& host_;
  std::mutex told_mutex_;
  std::set<std::string> told_;  ///< Missing assets that a warning was about.
};

}  // namespace diorama::loader_usd
