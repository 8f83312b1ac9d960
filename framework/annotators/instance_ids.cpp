// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/instance_ids.h"

#include <algorithm>
#include <vector>

namespace diorama {
std::vector<std::uint32_t> instance_of_leaf(std::span<const LabelledInstance> instances) {
  std::vector<std::uint32_t> table;
  for (const LabelledInstance& instance : instances) {
    for (const NodeId leaf : instance.leaves) {
      if (leaf.index >= table.size()) table.resize(leaf.index + 1, 0);
      table[leaf.index] = instance.node.index;
    }
  }
  return table;
}

Image<std::uint32_t> instance_ids(const std::vector<std::uint32_t>& table,
                                  Image<std::uint32_t> leaves) {
  std::ranges::transform(leaves.pixels(), leaves.pixels().begin(), [&](std::uint32_t leaf) {
    return leaf < table.size() ? table[leaf] : 0u;
  });
  return leaves;
}

NameSet InstanceIds::needs() const { return {std::string(kLeafId.name)}; }
NameSet InstanceIds::provides() const { return {std::string(kInstanceId.name)}; }

void InstanceIds::do_annotate(const Scene& scene, Frame& frame) const {
  frame.set(kInstanceId,
            instance_ids(instance_of_leaf(labelled_instances(scene)), frame.get(kLeafId)));
}

}  // namespace diorama
