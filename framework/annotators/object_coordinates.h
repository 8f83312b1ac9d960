// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/annotator.h"
#include "diorama/host.h"
#include "diorama/params.h"

namespace diorama {

/// Fills kObjectCoordinates: where in its instance's box a surface point lies (normalized object
/// coordinate space; Wang et al., CVPR 2019), each axis scaled to [0, 1] on its own. An axis along
/// which the box has no size gives 0.
class ObjectCoordinates final : public Annotator {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  ObjectCoordinates(Params, Host&) {}

  NameSet needs() const override;
  NameSet provides() const override;

 private:
  void do_annotate(const Scene& scene, Frame& frame) const override;
};

}  // namespace diorama
