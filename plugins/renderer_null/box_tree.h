// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "diorama/math.h"

namespace diorama {

/// A segment origin + t * direction, t in [t_min, t_max]; the direction has any length.
struct Segment {
  Vec3 origin = Vec3::Zero();
  Vec3 direction = -Vec3::UnitZ();
  double t_min = 0.0;
  double t_max = kInfinity;
};

/// Finds the boxes that a segment meets. Immutable once built; safe to ask from many threads.
class BoxTree {
 public:
  BoxTree() = default;
  explicit BoxTree(std::span<const Aabb> boxes);

  /// Calls test(index) for every box that the segment may meet. `test` may shorten segment.t_max.
  template <class Test>
  void visit(Segment& segment, Test&& test) const {
    if (nodes_.empty()) return;
    const Vec3 inverse = segment.direction.unaryExpr(&BoxTree::safe_inverse);
    std::array<std::uint32_t, 64> stack;
    std::size_t depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const BoxNode& node = nodes_[stack[--depth]];
      if (!meets(node.box, segment, inverse)) continue;
      if (node.count == 0) {
        stack[depth++] = node.first + 1;
        stack[depth++] = node.first;
        continue;
      }
      for (std::uint32_t i = 0; i < node.count; ++i) test(order_[node.first + i]);
    }
  }

 private:
  struct BoxNode {
    Aabb box;
    std::uint32_t first = 0;  ///< Of two neighbouring children, or of the leaf's boxes.
    std::uint32_t count = 0;  ///< 0: inner node.
  };

  static double safe_inverse(double x) {
    constexpr double kTiny = 1e-290;  // 0 * (1 / kTiny) stays 0 where 0 * infinity is no number
    return 1.0 / (x > kTiny || x < -kTiny ? x : kTiny);
  }
  static bool meets(const Aabb& box, const Segment& segment, const Vec3& inverse) {
    const Vec3 a = (box.min - segment.origin).cwiseProduct(inverse);
    const Vec3 b = (box.max - segment.origin).cwiseProduct(inverse);
    constexpr double kSlack = 1e-9;  // flat boxes keep their hits
    const double enter = a.cwiseMin(b).maxCoeff();
    const double leave = a.cwiseMax(b).minCoeff();
    return enter <= leave + kSlack * (1.0 + std::abs(leave)) && leave >= segment.t_min - kSlack &&
           enter <= segment.t_max + kSlack * (1.0 + std::abs(segment.t_max));
  }
  void build(std::span<const Aabb> boxes, std::uint32_t node, std::uint32_t begin,
             std::uint32_t end);

  std::vector<BoxNode> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace diorama
