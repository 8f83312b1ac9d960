// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/host.h"
#include "diorama/params.h"

namespace diorama {

/// Instance id by leaf id; leaves without a labelled node are 0.
std::vector<std::uint32_t> instance_of_leaf(std::span<const LabelledInstance> instances);

/// The ids of leaves replaced by those that `table`, of instance_of_leaf(), gives them.
Image<std::uint32_t> instance_ids(const std::vector<std::uint32_t>& table,
                                  Image<std::uint32_t> leaves);

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
