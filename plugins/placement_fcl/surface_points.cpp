// SPDX-License-Identifier: Apache-2.0
#include "surface_points.h"

#include <algorithm>
#include <cmath>

namespace diorama {

SurfacePoints::SurfacePoints(const Scene& scene, std::string_view pattern, double max_slope_rad) {
  const double least_up = std::cos(max_slope_rad) - 1e-9;
  double area = 0.0;
  for (const NodeId node : scene.match(pattern)) {
    const auto& mesh = scene[node].mesh;
    if (!mesh || !scene.is_visible(node)) continue;
    const Affine world_from_node = scene.world_from_node(node);
    // A mirrored node turns the order of the corners.
    const double side = world_from_node.linear().determinant() < 0.0 ? -1.0 : 1.0;
    const auto corner = [&](std::uint32_t index) -> Vec3 {
      return world_from_node * mesh->positions[index].cast<double>();
    };
    for (const auto& [a, b, c] : mesh->triangles) {
      Triangle triangle{corner(a), corner(b) - corner(a), corner(c) - corner(a)};
      const Vec3 normal = side * triangle.edge_a.cross(triangle.edge_b);
      if (normal.norm() <= 0.0 || normal.z() < least_up * normal.norm()) continue;
      area += 0.5 * normal.norm();
      triangle.area_so_far = area;
      triangles_.push_back(triangle);
    }
  }
}

Vec3 SurfacePoints::draw(Rng& rng) const {
  const double area = rng.uniform(0.0, triangles_.back().area_so_far);
  const auto chosen = std::upper_bound(
      triangles_.begin(), triangles_.end() - 1, area,
      [](double value, const Triangle& triangle) { return value < triangle.area_so_far; });
  double u = rng.uniform();
  double v = rng.uniform();
  // The upper half of the square folds onto the lower one.
  if (u + v > 1.0) {
    u = 1.0 - u;
    v = 1.0 - v;
  }
  return chosen->corner + u * chosen->edge_a + v * chosen->edge_b;
}

}  // namespace diorama
