// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/params.h"

namespace diorama::samples {

/// Serves "sample:<object>", "prop:<prop>" and "sky:<sky>": what the sample pack is made from.
/// Objects come as rigid bodies of their real mass with a convex hull; a sky is a dome light of
/// 1000 times its picture, in nits.
class SamplesLoader final : public Loader {
 public:
  struct Params {
    std::string set = "objects";
    void visit(ParamVisitor& v);
  };

  SamplesLoader(Params params, Host& host);

  std::vector<std::string> claims() const override;
  std::vector<std::string> assets() const override;
  void load(std::string_view asset, Scene& scene, NodeId root) override;

 private:
  Params params_;
  Host& host_;
};

}  // namespace diorama::samples
