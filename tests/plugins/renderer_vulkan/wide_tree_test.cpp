// SPDX-License-Identifier: Apache-2.0
#include "wide_tree.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"

namespace diorama {
namespace {

/// Walks the whole tree: what its leaves hold, and what waits on a ray's stack.
struct Walk {
  const WideTree& tree;
  const BoxTree& source;
  const std::vector<TreeBox>& boxes;
  std::vector<std::uint32_t> found;
  int most_waiting = 0;
  bool holds_all = true;
  double slack = 0.0;  ///< Of the boxes, in steps, at most.

  void node(std::uint32_t number, int waiting) {
    const WideNode& n = tree.nodes[number];
    int children = 0;
    for (const std::uint32_t child : n.children) children += child == WideNode::kNothing ? 0 : 1;
    waiting += std::max(children - 1, 0);
    most_waiting = std::max(most_waiting, waiting);
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t child = n.children[k];
      if (child == WideNode::kNothing) continue;
      const TreeBox inner = exact(child);
      for (int axis = 0; axis < 3; ++axis) {
        const double step = std::ldexp(1.0, int(n.exponents >> (8 * axis) & 255u) - 127);
        const double corner = double(n.corner[axis]);
        const double low = corner + step * n.low[std::size_t(axis)][k];
        const double high = corner + step * n.high[std::size_t(axis)][k];
        holds_all &= low <= double(inner.low[axis]) && high >= double(inner.high[axis]);
        slack = std::max(slack, (double(inner.low[axis]) - low) / step);
        slack = std::max(slack, (high - double(inner.high[axis])) / step);
      }
      if ((child & WideNode::kLeaf) == 0) node(child, waiting);
    }
  }
  /// Around all boxes below; notes those of leaves.
  TreeBox exact(std::uint32_t child) {
    TreeBox all;
    if ((child & WideNode::kLeaf) == 0) {
      for (const std::uint32_t c : tree.nodes[child].children) {
        if (c != WideNode::kNothing) all.add(exact_unnoted(c));
      }
      return all;
    }
    for (const std::uint32_t item : items(child)) found.push_back(item);
    return exact_unnoted(child);
  }
  TreeBox exact_unnoted(std::uint32_t child) const {
    TreeBox all;
    if ((child & WideNode::kLeaf) != 0) {
      for (const std::uint32_t item : items(child)) all.add(boxes[item]);
      return all;
    }
    for (const std::uint32_t c : tree.nodes[child].children) {
      if (c != WideNode::kNothing) all.add(exact_unnoted(c));
    }
    return all;
  }
  std::vector<std::uint32_t> items(std::uint32_t leaf) const {
    const std::uint32_t rest = leaf & ~WideNode::kLeaf;
    std::vector<std::uint32_t> items;
    for (std::uint32_t i = 0; i <= (rest & 7u); ++i) items.push_back(source.order[(rest >> 3) + i]);
    return items;
  }
};

void check(const std::vector<TreeBox>& boxes, double most_slack) {
  const BoxTree source = tree_of_runs(boxes);
  const WideTree tree = widened(source, 2);
  Walk walk{tree, source, boxes, {}};
  walk.node(0, 0);
  CAPTURE(boxes.size(), walk.slack);
  CHECK(walk.holds_all);
  CHECK(walk.slack <= most_slack);
  CHECK(walk.most_waiting == tree.most_waiting);
  CHECK(tree.most_waiting <= WideTree::kMostWaiting);
  std::ranges::sort(walk.found);
  std::vector<std::uint32_t> all = source.order;
  std::ranges::sort(all);
  CHECK(walk.found == all);
  for (const auto& [number, children] : tree.top) {
    CHECK(children.children == tree.nodes[number].children);
  }
}

}  // namespace

TEST_CASE("a wide tree holds what the tree holds that it was made of", "[wide_tree]") {
  Rng rng(9);
  for (const std::uint32_t count : {0u, 1u, 2u, 3u, 5u, 37u, 3000u}) {
    std::vector<TreeBox> boxes(count);
    for (TreeBox& box : boxes) {
      const Vec3f at(float(rng.uniform()) * 9.0f - 20.0f, float(rng.uniform()) * 3.0f,
                     float(rng.uniform()));
      box.add(at);
      box.add(Vec3f(at + Vec3f(0.1f, 0.0f, float(rng.uniform()))));
    }
    // A box reaches less than two steps beyond what it holds.
    check(boxes, 2.0);
  }
  CHECK(widened(tree_of_runs({}), 1).nodes.size() == 1);
}

TEST_CASE("flat, tiny, huge and far boxes are held", "[wide_tree]") {
  const auto box = [](const Vec3f& low, const Vec3f& size) {
    TreeBox result;
    result.add(low);
    result.add(Vec3f(low + size));
    return result;
  };
  check({box(Vec3f::Zero(), Vec3f::Zero()), box(Vec3f::Zero(), Vec3f(0, 1, 2))}, 2.0);
  check({box(Vec3f(1e6f, -1e6f, 0), Vec3f(0, 0.1f, 1e-9f)), box(Vec3f(1e6f, 3, 0), Vec3f::Zero())},
        2.0);
  check({box(Vec3f::Constant(-1e30f), Vec3f::Constant(2e30f)),
         box(Vec3f::Constant(1e-30f), Vec3f::Constant(1e-32f))},
        2.0);
}

TEST_CASE("chains of boxes make wide trees that rays' stacks hold", "[wide_tree]") {
  // Each reaches a little less far than the one before.
  std::vector<TreeBox> shrinking(2000);
  float size = 1e18f;
  for (TreeBox& box : shrinking) {
    box.add(Vec3f::Zero());
    box.add(Vec3f(size, 0.5f * size, size));
    size = std::max(size * 0.9f, 1e-12f);
  }
  check(shrinking, 300.0);
}

}  // namespace diorama
