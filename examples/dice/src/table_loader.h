// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <diorama/host.h>
#include <diorama/loader.h>
#include <diorama/params.h>

namespace dice {

/// Makes places where dice are thrown, from numbers: a table with or without sheet, tray and
/// clutter round it ("dice_table:7"), or a bare one of one colour ("plain_table:7"). The floor on
/// which dice land is at z = 0; the node `area` has axes that reach from its middle to its rims.
class TableLoader final : public diorama::Loader {
 public:
  struct Params {
    int models = 2000;
    int first = 1;
    std::string look = "any";
    void visit(diorama::ParamVisitor& v);
  };

  TableLoader(Params params, diorama::Host&) : params_(std::move(params)) {}

  std::vector<std::string> claims() const override { return {"dice_table:", "plain_table:"}; }
  std::vector<std::string> assets() const override;
  void load(std::string_view asset, diorama::Scene& scene, diorama::NodeId root) override;

 private:
  Params params_;
};

}  // namespace dice
