// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/point_diameter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace diorama {
namespace {

/// A tree of boxes over the points, halved along their longest sides.
class PointTree {
 public:
  struct Node {
    Vec3 min, max;
    std::size_t begin = 0, end = 0;
    std::size_t left = 0;  ///< The right child follows; 0: a leaf.
  };

  explicit PointTree(std::span<const Vec3f> points) {
    for (const Vec3f& point : points) points_.push_back(point.cast<double>());
    nodes_.emplace_back();
    nodes_[0].end = points_.size();
    for (std::size_t i = 0; i < nodes_.size(); ++i) split(i);
  }

  const Node& operator[](std::size_t i) const { return nodes_[i]; }
  std::span<const Vec3> points(const Node& node) const {
    return std::span(points_).subspan(node.begin, node.end - node.begin);
  }

 private:
  static constexpr std::size_t kLeafSize = 16;

  void split(std::size_t index) {
    Node node = nodes_[index];
    node.min = node.max = points_[node.begin];
    for (const Vec3& point : points(node)) {
      node.min = node.min.cwiseMin(point);
      node.max = node.max.cwiseMax(point);
    }
    if (node.end - node.begin > kLeafSize) {
      Eigen::Index axis = 0;
      (node.max - node.min).maxCoeff(&axis);
      const std::size_t middle = (node.begin + node.end) / 2;
      const auto at = [this](std::size_t i) { return points_.begin() + std::ptrdiff_t(i); };
      std::nth_element(at(node.begin), at(middle), at(node.end),
                       [axis](const Vec3& a, const Vec3& b) { return a[axis] < b[axis]; });
      node.left = nodes_.size();
      nodes_.push_back({{}, {}, node.begin, middle, 0});
      nodes_.push_back({{}, {}, middle, node.end, 0});
    }
    nodes_[index] = node;
  }

  std::vector<Vec3> points_;
  std::vector<Node> nodes_;
};

/// No two points of the boxes are further apart, not even by rounding.
double bound(const PointTree::Node& a, const PointTree::Node& b) {
  return (a.max - b.min).cwiseAbs().cwiseMax((b.max - a.min).cwiseAbs()).squaredNorm();
}

class Search {
 public:
  explicit Search(const PointTree& tree) : tree_(tree) {}

  /// Raises the best squared distance by the pairs with one point in each node.
  void visit(std::size_t first, std::size_t second) {
    const PointTree::Node& a = tree_[first];
    const PointTree::Node& b = tree_[second];
    if (bound(a, b) <= best_) return;
    if (a.left == 0 && b.left == 0) {
      for (const Vec3& p : tree_.points(a)) {
        for (const Vec3& q : tree_.points(b)) best_ = std::max(best_, (p - q).squaredNorm());
      }
      return;
    }
    const bool splits_first = b.left == 0 || (a.left != 0 && a.end - a.begin >= b.end - b.begin);
    std::size_t pairs[2][2] = {
        {splits_first ? a.left : first, splits_first ? second : b.left},
        {splits_first ? a.left + 1 : first, splits_first ? second : b.left + 1}};
    // The more promising pair first: it raises what the other must beat.
    const auto promise = [this](const std::size_t(&pair)[2]) {
      return bound(tree_[pair[0]], tree_[pair[1]]);
    };
    if (promise(pairs[1]) > promise(pairs[0])) std::swap(pairs[0], pairs[1]);
    for (const auto& pair : pairs) visit(pair[0], pair[1]);
  }

  double best() const { return best_; }

 private:
  const PointTree& tree_;
  double best_ = 0.0;
};

}  // namespace

double point_diameter(std::span<const Vec3f> points) {
  if (points.size() < 2) return 0.0;
  const PointTree tree(points);
  Search search(tree);
  search.visit(0, 0);
  return std::sqrt(search.best());
}

}  // namespace diorama
