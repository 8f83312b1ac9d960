// SPDX-License-Identifier: Apache-2.0
#include "box_tree.h"

#include <algorithm>
#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"

namespace diorama {
namespace {

bool contains(const TreeBox& outer, const TreeBox& inner) {
  return (outer.low.array() <= inner.low.array()).all() &&
         (outer.high.array() >= inner.high.array()).all();
}

/// Walks the whole tree: what its leaves hold, and how deep it is.
struct Walk {
  std::vector<std::uint32_t> found;
  int deepest = 0;
  bool is_nested = true;

  void node(const BoxTree& tree, const std::vector<TreeBox>& boxes, bool has_runs,
            std::uint32_t number, const TreeBox& around, int depth) {
    const TreeNode& n = tree.nodes[number];
    child(tree, boxes, has_runs, {n.low_a, n.high_a}, n.child_a, around, depth);
    child(tree, boxes, has_runs, {n.low_b, n.high_b}, n.child_b, around, depth);
  }
  void child(const BoxTree& tree, const std::vector<TreeBox>& boxes, bool has_runs,
             const TreeBox& box, std::uint32_t child, const TreeBox& around, int depth) {
    deepest = std::max(deepest, depth);
    if (!(box.low.array() <= box.high.array()).all()) return;  // nothing
    is_nested &= contains(around, box);
    if ((child & TreeNode::kLeaf) == 0) {
      return node(tree, boxes, has_runs, child, box, depth + 1);
    }
    const std::uint32_t rest = child & ~TreeNode::kLeaf;
    const std::uint32_t count = has_runs ? (rest & 7u) + 1 : 1;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t item = has_runs ? tree.order[(rest >> 3) + i] : rest;
      is_nested &= contains(box, boxes[item]);
      found.push_back(item);
    }
  }
};

Walk walk(const BoxTree& tree, const std::vector<TreeBox>& boxes, bool has_runs) {
  Walk walk;
  walk.node(tree, boxes, has_runs, 0, {Vec3f::Constant(-3e38f), Vec3f::Constant(3e38f)}, 1);
  std::ranges::sort(walk.found);
  return walk;
}

std::vector<TreeBox> random_boxes(std::uint32_t count) {
  Rng rng(7);
  std::vector<TreeBox> boxes(count);
  for (TreeBox& box : boxes) {
    const Vec3f at(float(rng.uniform()) * 9.0f, float(rng.uniform()) * 3.0f, float(rng.uniform()));
    box.add(at);
    box.add(Vec3f(at + Vec3f(0.1f, 0.02f, float(rng.uniform()))));
  }
  return boxes;
}

}  // namespace

TEST_CASE("the first levels of a tree are what the tree has there", "[box_tree]") {
  const BoxTree tree = tree_of_runs(random_boxes(500));
  CHECK(tree.top(0).empty());
  CHECK(tree.top(1).size() == 1);
  const auto top = tree.top(4);
  CHECK(top.size() > 4);
  CHECK(top.size() <= 15);
  for (const auto& [number, node] : top) {
    CHECK(node.child_a == tree.nodes[number].child_a);
    CHECK(node.low_b == tree.nodes[number].low_b);
  }
}

TEST_CASE("every box is in one leaf, and within all boxes above it", "[box_tree]") {
  for (const std::uint32_t count : {0u, 1u, 2u, 5u, 37u, 3000u}) {
    std::vector<TreeBox> boxes = random_boxes(count);
    if (count > 5) boxes[3] = TreeBox();  // empty: left out
    for (const bool has_runs : {true, false}) {
      const BoxTree tree = has_runs ? tree_of_runs(boxes) : tree_of_single(boxes);
      const Walk seen = walk(tree, boxes, has_runs);
      CAPTURE(count, has_runs);
      CHECK(seen.is_nested);
      CHECK(seen.deepest <= BoxTree::kDeepest);
      std::vector<std::uint32_t> all;
      for (std::uint32_t i = 0; i < count; ++i) {
        if (count <= 5 || i != 3) all.push_back(i);
      }
      CHECK(seen.found == all);
    }
  }
}

TEST_CASE("boxes at one place, and boxes of all sizes, make no deep tree", "[box_tree]") {
  std::vector<TreeBox> same(5000);
  for (TreeBox& box : same) {
    box.add(Vec3f(1.0f, 2.0f, 3.0f));
    box.add(Vec3f(1.5f, 2.5f, 3.5f));
  }
  const Walk equal = walk(tree_of_runs(same), same, true);
  CHECK(equal.found.size() == same.size());
  CHECK(equal.deepest <= 20);
  // Each reaches half as far as the one before: areas alone would cut them off one by one.
  std::vector<TreeBox> shrinking(2000);
  float size = 1e18f;
  for (TreeBox& box : shrinking) {
    box.add(Vec3f::Zero());
    box.add(Vec3f(size, 0.5f * size, size));
    size = std::max(size * 0.9f, 1e-18f);
  }
  const Walk deep = walk(tree_of_single(shrinking), shrinking, false);
  CHECK(deep.found.size() == shrinking.size());
  CHECK(deep.deepest <= BoxTree::kDeepest);
}

}  // namespace diorama
