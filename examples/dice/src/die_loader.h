// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <diorama/host.h>
#include <diorama/loader.h>
#include <diorama/params.h>

namespace dice {

/// Makes dice from numbers: "die:7" is one as shops sell them, "plain_die:7" a plain one. The nodes
/// face_1 ... face_6 below a die look along +z out of its faces.
class DieLoader final : public diorama::Loader {
 public:
  struct Params {
    int models = 500;
    int first = 1;
    std::string look = "any";
    void visit(diorama::ParamVisitor& v);
  };

  DieLoader(Params params, diorama::Host&) : params_(std::move(params)) {}

  std::vector<std::string> claims() const override { return {"die:", "plain_die:"}; }
  std::vector<std::string> assets() const override;
  void load(std::string_view asset, diorama::Scene& scene, diorama::NodeId root) override;

 private:
  Params params_;
};

/// The number after the colon of "scheme:7". Throws Error(Asset) that says what would be right.
std::uint64_t asset_number(std::string_view asset);

}  // namespace dice
