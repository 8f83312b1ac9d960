// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/annotator.h"
#include "diorama/host.h"
#include "diorama/params.h"

namespace diorama {

/// Fills Frame::instances: one entry per labelled instance of the scene, in the order of
/// labelled_instances(), everything but `visibility` (see visibility.h).
class Instances final : public Annotator {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  Instances(Params, Host&) {}

  NameSet needs() const override;
  NameSet provides() const override;  ///< The annotation "instances".

 private:
  void do_annotate(const Scene& scene, Frame& frame) const override;
};

}  // namespace diorama
