// SPDX-License-Identifier: Apache-2.0
#include "box_tree.h"

#include <algorithm>
#include <numeric>

namespace diorama {

BoxTree::BoxTree(std::span<const Aabb> boxes) {
  if (boxes.empty()) return;
  order_.resize(boxes.size());
  std::iota(order_.begin(), order_.end(), 0u);
  nodes_.reserve(boxes.size());
  nodes_.emplace_back();
  build(boxes, 0, 0, std::uint32_t(boxes.size()));
}

// Median splits keep the depth below log2(count) + 1, which the stack of visit() relies on.
void BoxTree::build(std::span<const Aabb> boxes, std::uint32_t node, std::uint32_t begin,
                    std::uint32_t end) {
  constexpr std::uint32_t kLeafSize = 4;
  Aabb all;
  Aabb centres;
  for (std::uint32_t i = begin; i < end; ++i) {
    all.add(boxes[order_[i]]);
    centres.add(boxes[order_[i]].centre());
  }
  nodes_[node].box = all;
  if (end - begin <= kLeafSize) {
    nodes_[node].first = begin;
    nodes_[node].count = end - begin;
    return;
  }
  Eigen::Index axis = 0;
  centres.size().maxCoeff(&axis);
  const std::uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) {
                     const double ca = boxes[a].min[axis] + boxes[a].max[axis];
                     const double cb = boxes[b].min[axis] + boxes[b].max[axis];
                     return ca != cb ? ca < cb : a < b;
                   });
  const auto children = std::uint32_t(nodes_.size());
  nodes_[node].first = children;
  nodes_.resize(nodes_.size() + 2);
  build(boxes, children, begin, middle);
  build(boxes, children + 1, middle, end);
}

}  // namespace diorama
