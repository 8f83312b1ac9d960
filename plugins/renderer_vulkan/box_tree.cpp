// SPDX-License-Identifier: Apache-2.0
#include "box_tree.h"

#include <algorithm>
#include <array>
#include <utility>

namespace diorama {
namespace {

constexpr int kBins = 16;
constexpr int kSplitByArea = 20;    // levels; below them by halves
constexpr float kTraversal = 1.2f;  // cost of a node, where that of a box is one

float area(const TreeBox& box) {
  const Vec3f size = (box.high - box.low).cwiseMax(0.0f);
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

struct Split {
  float cost = 3e38f;
  int axis = -1;
  int bin = 0;  ///< The last one of the first half.
};

class Builder {
 public:
  Builder(std::span<const TreeBox> boxes, bool has_runs) : boxes_(boxes), has_runs_(has_runs) {
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
      if (boxes[i].is_empty()) continue;
      tree_.order.push_back(i);
    }
    centres_.reserve(boxes.size());
    for (const TreeBox& box : boxes) centres_.push_back(0.5f * (box.low + box.high));
  }

  BoxTree build() {
    tree_.nodes.emplace_back();
    if (!tree_.order.empty()) {
      const std::uint32_t child = add(0, std::uint32_t(tree_.order.size()), 0);
      // A root that is a leaf gets a node above it.
      if ((child & TreeNode::kLeaf) != 0) set_child(0, true, bounds(0, count()), child);
    }
    if (!has_runs_) tree_.order.clear();
    return std::move(tree_);
  }

 private:
  std::uint32_t count() const { return std::uint32_t(tree_.order.size()); }

  TreeBox bounds(std::uint32_t begin, std::uint32_t end) const {
    TreeBox box;
    for (std::uint32_t i = begin; i < end; ++i) box.add(boxes_[tree_.order[i]]);
    return box;
  }

  void set_child(std::uint32_t node, bool is_first, const TreeBox& box, std::uint32_t child) {
    TreeNode& n = tree_.nodes[node];
    (is_first ? n.low_a : n.low_b) = box.low;
    (is_first ? n.high_a : n.high_b) = box.high;
    (is_first ? n.child_a : n.child_b) = child;
  }

  std::uint32_t leaf(std::uint32_t begin, std::uint32_t end) const {
    return TreeNode::kLeaf | (has_runs_ ? begin << 3 | (end - begin - 1) : tree_.order[begin]);
  }

  /// Returns the child that stands for these boxes. The root is node 0.
  std::uint32_t add(std::uint32_t begin, std::uint32_t end, int depth) {
    const std::uint32_t size = end - begin;
    if (size == 1) return leaf(begin, end);
    std::uint32_t middle = begin;
    if (depth < kSplitByArea) {
      const Split split = best_split(begin, end);
      const float leaf_cost = float(size);
      const bool may_be_leaf = has_runs_ && size <= BoxTree::kMostPerLeaf;
      if (may_be_leaf && leaf_cost <= split.cost) return leaf(begin, end);
      if (split.axis >= 0) middle = divide(begin, end, split);
    } else if (has_runs_ && size <= BoxTree::kMostPerLeaf) {
      return leaf(begin, end);
    }
    if (middle == begin || middle == end) middle = halve(begin, end);
    std::uint32_t node = 0;
    if (depth > 0) {
      node = std::uint32_t(tree_.nodes.size());
      tree_.nodes.emplace_back();
    }
    const TreeBox first = bounds(begin, middle);
    const TreeBox second = bounds(middle, end);
    set_child(node, true, first, add(begin, middle, depth + 1));
    set_child(node, false, second, add(middle, end, depth + 1));
    return node;
  }

  struct Bins {
    Vec3f low;
    Vec3f scale;
    int of(const Vec3f& centre, int axis) const {
      return std::clamp(int((centre[axis] - low[axis]) * scale[axis]), 0, kBins - 1);
    }
  };
  Bins bins_of(std::uint32_t begin, std::uint32_t end) const {
    TreeBox centres;
    for (std::uint32_t i = begin; i < end; ++i) centres.add(centres_[tree_.order[i]]);
    const Vec3f size = centres.high - centres.low;
    Vec3f scale = Vec3f::Zero();
    for (int k = 0; k < 3; ++k) {
      if (size[k] > 0.0f) scale[k] = float(kBins) * 0.9999f / size[k];
    }
    return {centres.low, scale};
  }

  Split best_split(std::uint32_t begin, std::uint32_t end) const {
    const Bins bins = bins_of(begin, end);
    std::array<std::array<TreeBox, kBins>, 3> boxes;
    std::array<std::array<std::uint32_t, kBins>, 3> counts{};
    for (std::uint32_t i = begin; i < end; ++i) {
      const std::uint32_t item = tree_.order[i];
      for (int axis = 0; axis < 3; ++axis) {
        const auto bin = std::size_t(bins.of(centres_[item], axis));
        boxes[std::size_t(axis)][bin].add(boxes_[item]);
        ++counts[std::size_t(axis)][bin];
      }
    }
    Split best;
    const float whole = std::max(area(bounds(begin, end)), 1e-30f);
    for (int axis = 0; axis < 3; ++axis) {
      if (!(bins.scale[axis] > 0.0f)) continue;
      const auto& own = boxes[std::size_t(axis)];
      const auto& own_counts = counts[std::size_t(axis)];
      std::array<float, kBins> after{};  // cost of the bins behind
      TreeBox box;
      std::uint32_t count = 0;
      for (std::size_t bin = kBins - 1; bin > 0; --bin) {
        box.add(own[bin]);
        count += own_counts[bin];
        after[bin - 1] = count > 0 ? area(box) * float(count) : 0.0f;
      }
      box = TreeBox();
      count = 0;
      for (std::size_t bin = 0; bin + 1 < kBins; ++bin) {
        box.add(own[bin]);
        count += own_counts[bin];
        if (count == 0 || count == end - begin) continue;
        const float cost = kTraversal + (area(box) * float(count) + after[bin]) / whole;
        if (cost < best.cost) best = {cost, axis, int(bin)};
      }
    }
    return best;
  }

  std::uint32_t divide(std::uint32_t begin, std::uint32_t end, const Split& split) {
    const Bins bins = bins_of(begin, end);
    const auto first = tree_.order.begin() + begin;
    const auto middle = std::stable_partition(
        first, tree_.order.begin() + end,
        [&](std::uint32_t item) { return bins.of(centres_[item], split.axis) <= split.bin; });
    return std::uint32_t(middle - tree_.order.begin());
  }

  /// Along the widest axis.
  std::uint32_t halve(std::uint32_t begin, std::uint32_t end) {
    TreeBox centres;
    for (std::uint32_t i = begin; i < end; ++i) centres.add(centres_[tree_.order[i]]);
    Eigen::Index axis = 0;
    (centres.high - centres.low).maxCoeff(&axis);
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(tree_.order.begin() + begin, tree_.order.begin() + middle,
                     tree_.order.begin() + end, [&](std::uint32_t p, std::uint32_t q) {
                       const float a = centres_[p][axis];
                       const float b = centres_[q][axis];
                       return a != b ? a < b : p < q;
                     });
    return middle;
  }

  std::span<const TreeBox> boxes_;
  bool has_runs_;
  std::vector<Vec3f> centres_;
  BoxTree tree_;
};

}  // namespace

std::map<std::uint32_t, TreeNode> BoxTree::top(int levels) const {
  std::map<std::uint32_t, TreeNode> found;
  std::vector<std::uint32_t> level{0};
  for (int i = 0; i < levels; ++i) {
    std::vector<std::uint32_t> next;
    for (const std::uint32_t number : level) {
      const TreeNode& node = nodes[number];
      found.emplace(number, node);
      for (const std::uint32_t child : {node.child_a, node.child_b}) {
        if ((child & TreeNode::kLeaf) == 0) next.push_back(child);
      }
    }
    level = std::move(next);
  }
  return found;
}

BoxTree tree_of_runs(std::span<const TreeBox> boxes) { return Builder(boxes, true).build(); }

BoxTree tree_of_single(std::span<const TreeBox> boxes) { return Builder(boxes, false).build(); }

}  // namespace diorama
