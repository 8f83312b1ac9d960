// SPDX-License-Identifier: Apache-2.0
#include "diorama/annotator.h"
#include "test_writer.h"

namespace {

struct Edges final : diorama::Annotator {
  struct Params {
    void visit(diorama::ParamVisitor&) {}
  };
  Edges(Params, diorama::Host&) {}
  diorama::NameSet needs() const override { return {}; }
  diorama::NameSet provides() const override { return {"edges"}; }
  void do_annotate(const diorama::Scene&, diorama::Frame&) const override {}
};

}  // namespace

// Listed with other channels than it is registered with.
__attribute__((section(".diorama_components"), used)) static const DioramaComponentEntry entry{
    std::uint32_t(diorama::ComponentKind::Annotator), 0, "edges", "Edges.", "", "", "corners"};

DIORAMA_PLUGIN("lists_other_channels", "1.0.0", "MIT") {
  diorama::add<Edges>(registrar, "edges", "Edges.", {"", "", "edges"});
}
