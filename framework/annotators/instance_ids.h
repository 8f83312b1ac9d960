// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/annotator.h"
#include "diorama/host.h"
#include "diorama/params.h"

namespace diorama {

/// Derives kInstanceId from kLeafId.
class InstanceIds final : public Annotator {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  InstanceIds(Params, Host&) {}

  NameSet needs() const override;
  NameSet provides() const override;

 private:
  void do_annotate(const Scene& scene, Frame& frame) const override;
};

}  // namespace diorama
