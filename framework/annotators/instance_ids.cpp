// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/instance_ids.h"

#include <algorithm>
#include <vector>

namespace diorama {
namespace {

/// Instance id by leaf id; leaves without a labelled node are 0.
std::vector<std::uint32_t> instance_of_leaf(const Scene& scene) {
  std::vector<std::uint32_t> table;
  for (const LabelledInstance& instance : labelled_instances(scene)) {
    for (const NodeId leaf : instance.leaves) {
      if (leaf.index >= table.size()) table.resize(leaf.index + 1, 0);
      table[leaf.index] = instance.node.index;
    }
  }
  return table;
}

}  // namespace

NameSet InstanceIds::needs() const { return {std::string(kLeafId.name)}; }
NameSet InstanceIds::provides() const { return {std::string(kInstanceId.name)}; }

void InstanceIds::do_annotate(const Scene& scene, Frame& frame) const {
  const std::vector<std::uint32_t> table = instance_of_leaf(scene);
  Image<std::uint32_t> ids = frame.get(kLeafId);
  std::ranges::transform(ids.pixels(), ids.pixels().begin(), [&](std::uint32_t leaf) {
    return leaf < table.size() ? table[leaf] : 0u;
  });
  frame.set(kInstanceId, std::move(ids));
}

}  // namespace diorama
