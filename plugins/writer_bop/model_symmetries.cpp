// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/model_symmetries.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

namespace diorama {
namespace {

using Triangle = std::array<Vec3, 3>;

/// The nearest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
Vec3 nearest_point(const Triangle& t, const Vec3& p) {
  const auto& [a, b, c] = t;
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return a;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return b;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return c;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return a + d1 / (d1 - d3) * ab;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const double sum = va + vb + vc;
  return a + vb / sum * ab + vc / sum * ac;
}

/// Distances to a surface, by a tree of boxes.
class Surface {
 public:
  explicit Surface(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
    nodes_.push_back({{}, 0, triangles_.size(), 0});
    for (std::size_t i = 0; i < nodes_.size(); ++i) split(i);
  }

  const std::vector<Triangle>& triangles() const { return triangles_; }

  /// The distance, or `limit` when it is not less.
  double distance(const Vec3& p, double limit) const {
    double best = limit * limit;
    search(0, p, best);
    return std::sqrt(best);
  }

 private:
  struct Node {
    Aabb box;
    std::size_t begin = 0, end = 0;
    std::size_t left = 0;  ///< The right child follows; 0: a leaf.
  };

  void split(std::size_t index) {
    Node node = nodes_[index];
    const auto at = [this](std::size_t i) { return triangles_.begin() + std::ptrdiff_t(i); };
    for (std::size_t i = node.begin; i < node.end; ++i) {
      for (const Vec3& corner : triangles_[i]) node.box.add(corner);
    }
    if (node.end - node.begin > 4) {
      Eigen::Index axis = 0;
      node.box.size().maxCoeff(&axis);
      const std::size_t middle = (node.begin + node.end) / 2;
      std::nth_element(
          at(node.begin), at(middle), at(node.end), [axis](const Triangle& a, const Triangle& b) {
            return a[0][axis] + a[1][axis] + a[2][axis] < b[0][axis] + b[1][axis] + b[2][axis];
          });
      node.left = nodes_.size();
      nodes_.push_back({{}, node.begin, middle, 0});
      nodes_.push_back({{}, middle, node.end, 0});
    }
    nodes_[index] = node;
  }

  double squared_distance_to_box(std::size_t index, const Vec3& p) const {
    const Aabb& box = nodes_[index].box;
    return (p - p.cwiseMax(box.min).cwiseMin(box.max)).squaredNorm();
  }

  void search(std::size_t index, const Vec3& p, double& best) const {
    const Node& node = nodes_[index];
    if (node.left == 0) {
      for (std::size_t i = node.begin; i < node.end; ++i) {
        best = std::min(best, (nearest_point(triangles_[i], p) - p).squaredNorm());
      }
      return;
    }
    std::size_t near = node.left, far = node.left + 1;
    double near_distance = squared_distance_to_box(near, p);
    double far_distance = squared_distance_to_box(far, p);
    if (far_distance < near_distance) {
      std::swap(near, far);
      std::swap(near_distance, far_distance);
    }
    if (near_distance < best) search(near, p, best);
    if (far_distance < best) search(far, p, best);
  }

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

std::vector<Triangle> triangles_of(const BopModel& model) {
  std::vector<Triangle> triangles;
  for (const auto& corners : model.triangles) {
    Triangle triangle;
    for (std::size_t i = 0; i < 3; ++i) triangle[i] = model.positions[corners[i]].cast<double>();
    triangles.push_back(triangle);
  }
  return triangles;
}

/// Mean and second moments of points spread evenly over the surface, exactly.
struct Moments {
  Vec3 centre = Vec3::Zero();
  Mat3 spread = Mat3::Zero();
};

Moments moments_of(const std::vector<Triangle>& triangles) {
  double area = 0.0;
  Moments moments;
  Mat3 second = Mat3::Zero();
  for (const auto& [a, b, c] : triangles) {
    const double own = 0.5 * (b - a).cross(c - a).norm();
    const Vec3 sum = a + b + c;
    area += own;
    moments.centre += own / 3.0 * sum;
    second += own / 12.0 *
              (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  if (area <= 0.0) return moments;
  moments.centre /= area;
  moments.spread = second / area - moments.centre * moments.centre.transpose();
  return moments;
}

/// Points that show every part: some of the corners, and points spread evenly by area.
std::vector<Vec3> samples_of(const std::vector<Triangle>& triangles) {
  constexpr std::size_t kCorners = 900;
  constexpr int kSpread = 600;
  std::vector<Vec3> points;
  const std::size_t stride = 3 * triangles.size() / kCorners + 1;
  for (std::size_t i = 0; i < 3 * triangles.size(); i += stride) {
    points.push_back(triangles[i / 3][i % 3]);
  }
  std::vector<double> area_until;
  double area = 0.0;
  for (const auto& [a, b, c] : triangles) {
    area += (b - a).cross(c - a).norm();
    area_until.push_back(area);
  }
  for (int i = 0; i < kSpread; ++i) {
    const double place = (i + 0.5) / kSpread * area;
    const auto found = std::ranges::lower_bound(area_until, place);
    if (found == area_until.end()) break;
    const auto& [a, b, c] = triangles[std::size_t(found - area_until.begin())];
    // The R2 sequence (Roberts 2018), folded into the triangle.
    double u = std::fmod(0.7548776662466927 * (i + 1), 1.0);
    double v = std::fmod(0.5698402909980532 * (i + 1), 1.0);
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    points.push_back(a + u * (b - a) + v * (c - a));
  }
  return points;
}

class Finder {
 public:
  Finder(const BopModel& model, double tolerance)
      : surface_(triangles_of(model)),
        samples_(samples_of(surface_.triangles())),
        moments_(moments_of(surface_.triangles())),
        tolerance_(tolerance) {
    for (const Vec3& point : samples_) reach_ = std::max(reach_, (point - centre()).norm());
    // What fails, fails first at the outermost points.
    std::ranges::stable_sort(samples_, std::ranges::greater(),
                             [this](const Vec3& p) { return (p - centre()).squaredNorm(); });
  }

  ModelSymmetries run() {
    if (reach_ <= 2.0 * tolerance_) return {};
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(moments_.spread);
    const Vec3 sizes = solver.eigenvalues();  // from the smallest
    std::array<Vec3, 3> axes;
    for (int i = 0; i < 3; ++i) axes[std::size_t(i)] = tidy(solver.eigenvectors().col(i));
    const bool low_equal = are_equal(sizes[0], sizes[1]);
    const bool high_equal = are_equal(sizes[1], sizes[2]);
    if (low_equal && high_equal) {
      try_sphere_or_solid(axes);
    } else if (low_equal || high_equal) {
      try_main_axis(axes[low_equal ? 2 : 0]);
    } else {
      for (const Vec3& axis : axes) try_turn(axis, 2);
    }
    close_group();
    return result_;
  }

 private:
  const Vec3& centre() const { return moments_.centre; }

  /// Principal axes of what is as equal as this are not to be relied on.
  static bool are_equal(double a, double b) { return std::abs(a - b) < 0.02 * std::max(a, b); }

  /// Axes along those of the model are so exactly.
  static Vec3 tidy(Vec3 axis) {
    for (int i = 0; i < 3; ++i) {
      if (std::abs(axis[i]) < 1e-3) axis[i] = 0.0;
    }
    axis.normalize();
    // Of both directions, the one whose last part is positive.
    for (int i = 2; i >= 0; --i) {
      if (axis[i] != 0.0) return axis[i] < 0.0 ? Vec3(-axis) : axis;
    }
    return axis;
  }

  Affine turn(const Vec3& axis, double angle) const {
    Affine map = Affine::Identity();
    map.linear() = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    for (double& value : map.linear().reshaped()) value = std::round(value * 1e12) / 1e12;
    map.translation() = centre() - map.linear() * centre();
    return map;
  }

  /// How far the turned surface is from itself, `limit` when it is not less.
  double deviation(const Affine& map, double limit) const {
    double worst = 0.0;
    for (const Vec3& point : samples_) {
      worst = std::max(worst, surface_.distance(map * point, limit));
      if (worst >= limit) break;
    }
    return worst;
  }

  bool holds(const Affine& map) const { return deviation(map, tolerance_) < tolerance_; }

  bool is_round(const Vec3& axis) const {
    // Angles that share no divisor with any count of sides.
    for (int i = 1; i <= 12; ++i) {
      if (!holds(turn(axis, 2.0 * kPi * std::fmod(0.6180339887498949 * i, 1.0)))) return false;
    }
    return true;
  }

  bool try_turn(const Vec3& axis, int count) {
    const Affine map = turn(axis, 2.0 * kPi / count);
    if (!holds(map)) return false;
    generators_.push_back(map.linear());
    return true;
  }

  /// The largest number of equal turns about an axis.
  int try_turns(const Vec3& axis, int most) {
    for (int count = most; count > 1; --count) {
      if (try_turn(axis, count)) return count;
    }
    return 1;
  }

  void add_round(const Vec3& axis) {
    Vec3 point = centre() - centre().dot(axis) * axis;
    for (double& value : point) value = std::round(value * 1e6) / 1e6;
    result_.continuous.push_back({axis, point});
  }

  /// About an axis that is the only one of its kind; then half turns across it.
  void try_main_axis(const Vec3& axis) {
    constexpr int kMostSides = 36;
    const Vec3 across = tidy(axis.unitOrthogonal());
    if (is_round(axis)) {
      add_round(axis);
      try_turn(across, 2);
      return;
    }
    const int count = try_turns(axis, kMostSides);
    if (const auto angle = half_turn_angle(axis, across, count)) {
      try_turn(tidy(Eigen::AngleAxisd(*angle, axis) * across), 2);
    }
  }

  /// Where among the directions across an axis one of a half turn lies.
  std::optional<double> half_turn_angle(const Vec3& axis, const Vec3& across, int count) const {
    const double range = kPi / count;
    const int steps = int(std::ceil(range * reach_ / tolerance_));
    const double step = range / steps;
    const auto deviation_at = [&](double angle) {
      return deviation(turn(Eigen::AngleAxisd(angle, axis) * across, kPi), 4.0 * tolerance_);
    };
    double best = 4.0 * tolerance_;
    double best_angle = 0.0;
    for (int i = 0; i < steps; ++i) {
      const double found = deviation_at(i * step);
      if (found >= best) continue;
      best = found;
      best_angle = i * step;
    }
    if (best >= 4.0 * tolerance_) return std::nullopt;
    for (double width = 0.5 * step; width > 1e-5; width *= 0.5) {
      for (const double angle : {best_angle - width, best_angle + width}) {
        const double found = deviation_at(angle);
        if (found >= best) continue;
        best = found;
        best_angle = angle;
      }
    }
    return best_angle;
  }

  /// Directions to the outermost points, between two of them, and the model's own axes.
  std::vector<Vec3> directions() const {
    std::vector<Vec3> outermost;
    for (const Vec3& point : samples_) {
      const Vec3 arm = point - centre();
      if (arm.norm() < reach_ - tolerance_ || outermost.size() >= 24) break;
      add_direction(arm, outermost);
    }
    std::vector<Vec3> all;
    for (const Vec3& axis : {Vec3(Vec3::UnitZ()), Vec3(Vec3::UnitY()), Vec3(Vec3::UnitX())}) {
      add_direction(axis, all);
    }
    for (const Vec3& arm : outermost) add_direction(arm, all);
    for (const Vec3& a : outermost) {
      for (const Vec3& b : outermost) {
        if ((a + b).norm() > 0.2) add_direction(a + b, all);
        if ((a - b).norm() > 0.2) add_direction(a - b, all);
      }
    }
    return all;
  }

  static void add_direction(const Vec3& arm, std::vector<Vec3>& list) {
    const Vec3 axis = tidy(arm.normalized());
    const auto is_same = [&axis](const Vec3& other) { return std::abs(axis.dot(other)) > 0.9998; };
    if (std::ranges::none_of(list, is_same)) list.push_back(axis);
  }

  void try_sphere_or_solid(const std::array<Vec3, 3>& axes) {
    const bool is_sphere =
        is_round(Vec3::UnitX()) && is_round(Vec3::UnitY()) && is_round(Vec3(0.6, 0.64, 0.48));
    if (is_sphere) {
      for (const Vec3& axis : {Vec3(Vec3::UnitX()), Vec3(Vec3::UnitY()), Vec3(Vec3::UnitZ())}) {
        add_round(axis);
      }
      return;
    }
    std::vector<Vec3> all = directions();
    for (const Vec3& axis : axes) add_direction(axis, all);
    const auto round = std::ranges::find_if(all, [this](const Vec3& a) { return is_round(a); });
    if (round != all.end()) return try_main_axis(*round);
    constexpr int kMostTurns = 5;  // of a solid with more than one such axis
    for (const Vec3& axis : all) try_turns(axis, kMostTurns);
  }

  /// All products of what was found.
  void close_group() {
    constexpr std::size_t kLargest = 120;
    constexpr double kSameAngle = 0.03;
    std::vector<Mat3> group{Mat3::Identity()};
    for (std::size_t i = 0; i < group.size() && group.size() < kLargest; ++i) {
      for (const Mat3& generator : generators_) {
        const Mat3 product = group[i] * generator;
        const bool is_known = std::ranges::any_of(group, [&](const Mat3& known) {
          return Eigen::AngleAxisd(Mat3(known.transpose() * product)).angle() < kSameAngle;
        });
        if (!is_known) group.push_back(product);
      }
    }
    for (const Mat3& rotation : std::span(group).subspan(1)) {
      Affine map = Affine::Identity();
      map.linear() = rotation;
      for (double& value : map.linear().reshaped()) value = std::round(value * 1e9) / 1e9 + 0.0;
      map.translation() = centre() - map.linear() * centre();
      for (double& value : map.translation()) value = std::round(value * 1e6) / 1e6 + 0.0;
      result_.discrete.push_back(map);
    }
  }

  Surface surface_;
  std::vector<Vec3> samples_;
  Moments moments_;
  double tolerance_;
  double reach_ = 0.0;
  std::vector<Mat3> generators_;
  ModelSymmetries result_;
};

}  // namespace

ModelSymmetries find_symmetries(const BopModel& model, double tolerance) {
  if (model.is_empty() || !(tolerance > 0.0)) return {};
  return Finder(model, tolerance).run();
}

}  // namespace diorama
