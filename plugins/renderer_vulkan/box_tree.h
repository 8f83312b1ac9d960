// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "diorama/math.h"

namespace diorama {

/// A box around something that rays may meet. Empty: nothing can.
struct TreeBox {
  Vec3f low = Vec3f::Constant(3e38f);
  Vec3f high = Vec3f::Constant(-3e38f);

  bool is_empty() const { return !(low.array() <= high.array()).all(); }
  void add(const Vec3f& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  void add(const TreeBox& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
};

/// Two children, as kernels read them. Children are nodes, or leaves: kLeaf with what stands there.
struct TreeNode {
  static constexpr std::uint32_t kLeaf = 0x80000000u;
  /// The box of a child that is not there: a place farther away than rays reach. An empty box would
  /// not do: kernels take its ends for one another, and enter it.
  static Vec3f nowhere() { return {1.1e38f, -1.7e38f, 2.3e38f}; }

  Vec3f low_a = nowhere();
  std::uint32_t child_a = kLeaf;
  Vec3f high_a = nowhere();
  std::uint32_t pad_a = 0;
  Vec3f low_b = nowhere();
  std::uint32_t child_b = kLeaf;
  Vec3f high_b = nowhere();
  std::uint32_t pad_b = 0;

  /// Only a root has less than two children.
  bool has_a() const { return low_a != nowhere(); }
  bool has_b() const { return low_b != nowhere(); }
};
static_assert(sizeof(TreeNode) == 64);

/// A tree of boxes that rays pass fast: split where the surface area heuristic says so, among bins
/// (Wald 2007), and not too deep for the kernels' stacks.
struct BoxTree {
  /// Boxes below one leaf at most.
  static constexpr std::uint32_t kMostPerLeaf = 4;
  /// No path from the root is longer, for up to 2^26 boxes.
  static constexpr int kDeepest = 46;

  std::vector<TreeNode> nodes;       ///< The root first; there is always one.
  std::vector<std::uint32_t> order;  ///< Of the boxes as leaves hold them, without the empty ones.

  /// The nodes of the first levels, by their numbers.
  std::map<std::uint32_t, TreeNode> top(int levels) const;
};

/// Leaves hold a run of `order`: kLeaf | first << 3 | count - 1.
BoxTree tree_of_runs(std::span<const TreeBox> boxes);
/// Leaves hold one box: kLeaf | its index. `order` stays empty.
BoxTree tree_of_single(std::span<const TreeBox> boxes);

}  // namespace diorama
