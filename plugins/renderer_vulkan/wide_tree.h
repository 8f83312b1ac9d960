// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "box_tree.h"

namespace diorama {

/// Four children, as kernels read them. Their boxes stand in steps from a corner that is below all
/// of them; a step is a power of two along each axis.
struct WideNode {
  static constexpr std::uint32_t kLeaf = TreeNode::kLeaf;
  static constexpr std::uint32_t kNothing = 0xFFFFFFFFu;
  using Steps = std::array<std::array<std::uint8_t, 4>, 3>;  ///< By axis and child.

  Vec3f corner = Vec3f::Zero();
  std::uint32_t exponents = 0;  ///< Of the steps, as floats have them: x | y << 8 | z << 16.
  std::array<std::uint32_t, 4> children{kNothing, kNothing, kNothing, kNothing};
  Steps low{};
  Steps high{};
  std::array<std::uint32_t, 2> pad{};
};
static_assert(sizeof(WideNode) == 64);

/// A tree as rays pass it on a device: a node is one read for four boxes (Ylitie et al. 2017).
struct WideTree {
  /// Entries that wait at most on the stack of a ray.
  static constexpr int kMostWaiting = 3 * (BoxTree::kDeepest / 2);

  /// Of a node, before rounding.
  struct Children {
    std::array<TreeBox, 4> boxes;
    std::array<std::uint32_t, 4> children{WideNode::kNothing, WideNode::kNothing,
                                          WideNode::kNothing, WideNode::kNothing};
  };
  std::vector<WideNode> nodes;             ///< The root first; there is always one.
  std::map<std::uint32_t, Children> top;  ///< Of the first levels, by their numbers.
  int most_waiting = 0;                    ///< On the stack of a ray through this tree.
};

/// Leaves are those of `tree`. `top_levels`: of which `top` is wanted.
WideTree widened(const BoxTree& tree, int top_levels);

}  // namespace diorama
