// SPDX-License-Identifier: Apache-2.0
#include "obstacles.h"

#include <algorithm>
#include <array>

namespace diorama {
namespace {

/// Slab test of the segment from + t * way, t in [0, 1].
bool crosses_box(const Aabb& box, const Vec3& from, const Vec3& way) {
  double enter = 0.0;
  double leave = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    if (way[axis] == 0.0) {
      if (from[axis] < box.min[axis] || from[axis] > box.max[axis]) return false;
      continue;
    }
    const double a = (box.min[axis] - from[axis]) / way[axis];
    const double b = (box.max[axis] - from[axis]) / way[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave;
}

std::array<Vec3, 3> corners(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle) {
  return {mesh.positions[triangle[0]].cast<double>(), mesh.positions[triangle[1]].cast<double>(),
          mesh.positions[triangle[2]].cast<double>()};
}

/// Moeller and Trumbore 1997.
bool crosses_triangle(const std::array<Vec3, 3>& corner, const Vec3& from, const Vec3& way) {
  const Vec3 ab = corner[1] - corner[0];
  const Vec3 ac = corner[2] - corner[0];
  const Vec3 p = way.cross(ac);
  const double det = ab.dot(p);
  if (det == 0.0) return false;
  const Vec3 to_from = from - corner[0];
  const double u = to_from.dot(p) / det;
  if (u < 0.0 || u > 1.0) return false;
  const Vec3 q = to_from.cross(ab);
  const double v = way.dot(q) / det;
  if (v < 0.0 || u + v > 1.0) return false;
  const double t = ac.dot(q) / det;
  return t >= 0.0 && t <= 1.0;
}

double squared_distance_to_edge(const Vec3& point, const Vec3& a, const Vec3& b) {
  const Vec3 along = b - a;
  const double length = along.squaredNorm();
  const double t = length > 0.0 ? std::clamp((point - a).dot(along) / length, 0.0, 1.0) : 0.0;
  return (a + t * along - point).squaredNorm();
}

double squared_distance(const Vec3& point, const std::array<Vec3, 3>& corner) {
  const Vec3 normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  bool is_over = normal.squaredNorm() > 0.0;
  double nearest = kInfinity;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& a = corner[i];
    const Vec3& b = corner[(i + 1) % 3];
    is_over = is_over && normal.cross(b - a).dot(point - a) >= 0.0;
    nearest = std::min(nearest, squared_distance_to_edge(point, a, b));
  }
  if (!is_over) return nearest;
  const double height = normal.dot(point - corner[0]);
  return height * height / normal.squaredNorm();
}

double squared_distance(const Vec3& point, const Aabb& box) {
  return (point - point.cwiseMax(box.min).cwiseMin(box.max)).squaredNorm();
}

}  // namespace

Obstacles::Obstacles(const Scene& scene, std::string_view pattern) {
  for (const NodeId id : scene.match(pattern)) {
    const auto& mesh = scene[id].mesh;
    if (!mesh || mesh->triangles.empty() || !scene.is_visible(id)) continue;
    Item item;
    item.mesh = mesh;
    item.world_from_mesh = scene.world_from_node(id);
    if (std::abs(item.world_from_mesh.linear().determinant()) < 1e-18) continue;
    item.mesh_from_world = item.world_from_mesh.inverse();
    item.box_mesh = mesh->bounds();
    item.box_world = item.box_mesh.mapped(item.world_from_mesh);
    items_.push_back(std::move(item));
  }
}

bool Obstacles::is_between(const Vec3& from_world, const Vec3& to_world) const {
  for (const Item& item : items_) {
    if (!crosses_box(item.box_world, from_world, to_world - from_world)) continue;
    const Vec3 from = item.mesh_from_world * from_world;
    const Vec3 way = item.mesh_from_world * to_world - from;
    if (!crosses_box(item.box_mesh, from, way)) continue;
    for (const auto& triangle : item.mesh->triangles) {
      if (crosses_triangle(corners(*item.mesh, triangle), from, way)) return true;
    }
  }
  return false;
}

bool Obstacles::is_near(const Vec3& point_world, double distance_m) const {
  const double limit = distance_m * distance_m;
  for (const Item& item : items_) {
    if (squared_distance(point_world, item.box_world) >= limit) continue;
    for (const auto& triangle : item.mesh->triangles) {
      std::array<Vec3, 3> corner = corners(*item.mesh, triangle);
      for (Vec3& point : corner) point = item.world_from_mesh * point;
      if (squared_distance(point_world, corner) < limit) return true;
    }
  }
  return false;
}

}  // namespace diorama
