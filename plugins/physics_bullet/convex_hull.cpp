// SPDX-License-Identifier: Apache-2.0
#include "convex_hull.h"

#include <LinearMath/btConvexHullComputer.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace diorama {
namespace {

struct Plane {
  Vec3 normal;
  double offset;
  double distance(const Vec3& point) const { return normal.dot(point) - offset; }
};

std::vector<Plane> face_planes(const ConvexHull& hull) {
  std::vector<Plane> planes;
  planes.reserve(hull.triangles.size());
  for (const auto& triangle : hull.triangles) {
    const Vec3& a = hull.points[triangle[0]];
    const Vec3 across = (hull.points[triangle[1]] - a).cross(hull.points[triangle[2]] - a);
    const double length = across.norm();
    if (!(length > 0.0)) continue;
    const Vec3 normal = across / length;
    planes.push_back({normal, normal.dot(a)});
  }
  return planes;
}

std::size_t farthest(std::span<const Vec3> points, const Vec3& direction) {
  std::size_t best = 0;
  double best_reach = points[0].dot(direction);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double reach = points[i].dot(direction);
    if (!(reach > best_reach)) continue;
    best = i;
    best_reach = reach;
  }
  return best;
}

std::vector<std::size_t> extreme_points(std::span<const Vec3> points) {
  std::vector<std::size_t> chosen;
  const auto choose = [&](const Vec3& direction) {
    const std::size_t i = farthest(points, direction);
    if (std::find(chosen.begin(), chosen.end(), i) == chosen.end()) chosen.push_back(i);
  };
  for (int axis = 0; axis < 3; ++axis) {
    choose(Vec3::Unit(axis));
    choose(-Vec3::Unit(axis));
  }
  for (int corner = 0; corner < 8; ++corner) {
    choose(Vec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1));
  }
  return chosen;
}

struct Outlier {
  double distance;
  std::size_t point;
};

/// Per face its farthest point outside, the most distant first.
std::vector<Outlier> outliers(std::span<const Vec3> points, const ConvexHull& hull,
                              double tolerance) {
  std::vector<Outlier> found;
  for (const Plane& plane : face_planes(hull)) {
    const std::size_t i = farthest(points, plane.normal);
    const double distance = plane.distance(points[i]);
    if (distance > tolerance) found.push_back({distance, i});
  }
  std::sort(found.begin(), found.end(), [](const Outlier& a, const Outlier& b) {
    return a.distance != b.distance ? a.distance > b.distance : a.point < b.point;
  });
  return found;
}

std::vector<Vec3> picked(std::span<const Vec3> points, const std::vector<std::size_t>& indices) {
  std::vector<Vec3> result;
  result.reserve(indices.size());
  for (const std::size_t i : indices) result.push_back(points[i]);
  return result;
}

double extent(std::span<const Vec3> points, const Vec3& direction) {
  return points[farthest(points, direction)].dot(direction) -
         points[farthest(points, -direction)].dot(direction);
}

}  // namespace

ConvexHull convex_hull(std::span<const Vec3> points) {
  ConvexHull hull;
  if (points.size() < 4) return hull;
  btConvexHullComputer computer;
  computer.compute(points.data()->data(), int(sizeof(Vec3)), int(points.size()), 0.0, 0.0);
  // The computer's own vertices are rounded to a grid.
  for (int i = 0; i < computer.original_vertex_index.size(); ++i) {
    hull.points.push_back(points[std::size_t(computer.original_vertex_index[i])]);
  }
  for (int i = 0; i < computer.faces.size(); ++i) {
    const auto* first = &computer.edges[computer.faces[i]];
    const auto corner = std::uint32_t(first->getSourceVertex());
    const auto* edge = first->getNextEdgeOfFace();
    for (; edge->getTargetVertex() != int(corner); edge = edge->getNextEdgeOfFace()) {
      hull.triangles.push_back(
          {corner, std::uint32_t(edge->getSourceVertex()), std::uint32_t(edge->getTargetVertex())});
    }
  }
  return hull;
}

std::vector<Vec3> reduced_hull_points(std::span<const Vec3> points, std::size_t max_points) {
  const std::vector<Vec3> full = convex_hull(points).points;
  if (full.size() <= max_points) return full;
  std::vector<std::size_t> chosen = extreme_points(full);
  Aabb box;
  for (const Vec3& point : full) box.add(point);
  const double tolerance = 1e-5 * box.size().norm();
  while (chosen.size() < max_points) {
    const std::vector<Outlier> found = outliers(full, convex_hull(picked(full, chosen)), tolerance);
    if (found.empty()) break;
    // One at a time: faces side by side share an outlier's neighbourhood, and points spent twice
    // there leave a flat elsewhere.
    const auto next = std::find_if(found.begin(), found.end(), [&](const Outlier& outlier) {
      return std::find(chosen.begin(), chosen.end(), outlier.point) == chosen.end();
    });
    if (next == found.end()) break;  // rounding: all outliers are chosen already
    chosen.push_back(next->point);
  }
  return convex_hull(picked(full, chosen)).points;
}

std::vector<Vec3> thickened(std::span<const Vec3> points, double thickness) {
  std::vector<Vec3> result(points.begin(), points.end());
  if (result.empty()) return result;
  Vec3 mean = Vec3::Zero();
  for (const Vec3& point : points) mean += point / double(points.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& point : points) spread += (point - mean) * (point - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(spread);
  for (int i = 0; i < 3; ++i) {
    const Vec3 axis = axes.eigenvectors().col(i);
    if (extent(result, axis) >= thickness) continue;
    const std::size_t count = result.size();
    for (std::size_t k = 0; k < count; ++k) {
      result.push_back(result[k] + 0.5 * thickness * axis);
      result[k] -= 0.5 * thickness * axis;
    }
  }
  return result;
}

double inner_distance(const ConvexHull& hull, const Vec3& point) {
  double smallest = kInfinity;
  for (const Plane& plane : face_planes(hull)) {
    smallest = std::min(smallest, -plane.distance(point));
  }
  return smallest;
}

}  // namespace diorama
