// SPDX-License-Identifier: Apache-2.0
#include "wide_tree.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace diorama {
namespace {

float area(const TreeBox& box) {
  const Vec3f size = (box.high - box.low).cwiseMax(0.0f);
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

bool is_empty(const TreeBox& box) { return !(box.low.array() <= box.high.array()).all(); }

std::uint8_t to_byte(double steps) {
  return steps > 0.0 ? std::uint8_t(std::min(steps, 255.0)) : std::uint8_t(0);
}

WideNode rounded(const WideTree::Children& from) {
  TreeBox all;
  for (const TreeBox& box : from.boxes) all.add(box);
  WideNode node;
  node.children = from.children;
  if (is_empty(all)) return node;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = double(all.low[axis]);
    const double high = double(all.high[axis]);
    // No finer than positions are, and one step is left on either side.
    const double need = std::max({(high - low) / 252.0,
                                  std::max(std::abs(low), std::abs(high)) * 0x1p-21, 1e-30});
    const int exponent = std::clamp(int(std::ceil(std::log2(need))), -100, 126);
    const double step = std::ldexp(1.0, exponent);
    const auto corner = float(low - step);
    node.corner[axis] = corner;
    node.exponents |= std::uint32_t(exponent + 127) << (8 * axis);
    // Kernels round as well, by much less than this.
    constexpr double kSlack = 1.0 / 256.0;
    for (std::size_t child = 0; child < 4; ++child) {
      const TreeBox& box = from.boxes[child];
      if (is_empty(box)) continue;
      const auto k = std::size_t(axis);
      node.low[k][child] =
          to_byte(std::floor((double(box.low[axis]) - double(corner)) / step - kSlack));
      node.high[k][child] =
          to_byte(std::ceil((double(box.high[axis]) - double(corner)) / step + kSlack));
    }
  }
  return node;
}

class Widener {
 public:
  Widener(const BoxTree& tree, int top_levels, bool is_flat)
      : tree_(tree), top_levels_(top_levels), is_flat_(is_flat), heights_(tree.nodes.size(), 0) {
    // Children stand behind their parents.
    for (std::size_t i = tree.nodes.size(); i-- > 0;) {
      const TreeNode& node = tree.nodes[i];
      heights_[i] = 1 + std::max(height_of(node.child_a), height_of(node.child_b));
    }
  }

  WideTree build() {
    add(0, 0);
    return std::move(wide_);
  }

 private:
  static bool is_leaf(std::uint32_t child) { return (child & TreeNode::kLeaf) != 0; }
  int height_of(std::uint32_t child) const { return is_leaf(child) ? 0 : heights_[child]; }

  struct Child {
    TreeBox box;
    std::uint32_t child = 0;
  };
  /// Of two nodes, whose children are to take its place: the larger one; or, to make the tree flat,
  /// the higher one.
  bool is_better(const Child& a, const Child& b) const {
    const int height_a = height_of(a.child);
    const int height_b = height_of(b.child);
    if (is_flat_ && height_a != height_b) return height_a > height_b;
    return area(a.box) > area(b.box);
  }

  /// Returns how many entries wait at most for a ray below.
  int add(std::uint32_t source, int level) {
    std::array<Child, 4> found;
    std::size_t count = 0;
    const auto put = [&](std::size_t place, const TreeBox& box, std::uint32_t child) {
      found[place] = {box, child};
    };
    const auto put_children_of = [&](std::uint32_t number, std::size_t place) {
      const TreeNode& node = tree_.nodes[number];
      const TreeBox a{node.low_a, node.high_a};
      const TreeBox b{node.low_b, node.high_b};
      if (is_empty(a) && is_empty(b)) {
        if (place < count) found[place] = found[--count];
        return;
      }
      const bool is_new = place == count;
      if (is_new) ++count;
      put(place, is_empty(a) ? b : a, is_empty(a) ? node.child_b : node.child_a);
      if (!is_empty(a) && !is_empty(b)) put(count++, b, node.child_b);
    };
    put_children_of(source, 0);
    while (count < 4) {
      std::size_t best = count;
      for (std::size_t i = 0; i < count; ++i) {
        if (is_leaf(found[i].child)) continue;
        if (best == count || is_better(found[i], found[best])) best = i;
      }
      if (best == count) break;
      put_children_of(found[best].child, best);
    }
    const auto number = std::uint32_t(wide_.nodes.size());
    wide_.nodes.emplace_back();
    WideTree::Children children;
    int waiting = 0;
    for (std::size_t i = 0; i < count; ++i) {
      children.boxes[i] = found[i].box;
      children.children[i] = found[i].child;
      if (is_leaf(found[i].child)) continue;
      children.children[i] = std::uint32_t(wide_.nodes.size());
      waiting = std::max(waiting, add(found[i].child, level + 1));
    }
    wide_.nodes[number] = rounded(children);
    if (level < top_levels_) wide_.top.emplace(number, children);
    waiting += std::max(int(count) - 1, 0);
    wide_.most_waiting = std::max(wide_.most_waiting, waiting);
    return waiting;
  }

  const BoxTree& tree_;
  int top_levels_;
  bool is_flat_;
  std::vector<int> heights_;
  WideTree wide_;
};

}  // namespace

WideTree widened(const BoxTree& tree, int top_levels) {
  WideTree wide = Widener(tree, top_levels, false).build();
  if (wide.most_waiting <= WideTree::kMostWaiting) return wide;
  return Widener(tree, top_levels, true).build();
}

}  // namespace diorama
