// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/support_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <unordered_map>
#include <utility>

namespace diorama {
namespace {

using Corners = std::array<Vec3, 3>;

bool overlap(const Aabb& a, const Aabb& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

Aabb grown(Aabb box, double by) {
  box.min.array() -= by;
  box.max.array() += by;
  return box;
}

Aabb box_of(const Corners& triangle) {
  Aabb box;
  for (const Vec3& corner : triangle) box.add(corner);
  return box;
}

/// One visible mesh where it stands.
struct Surface {
  NodeId node;
  NodeId owner;  ///< The object that it belongs to, or itself.
  Aabb box;
  bool is_room = false;
  std::vector<Corners> triangles;  ///< World; empty until somebody is near.
};

/// Calls body(point) for points so dense that none of the triangle is farther than two thirds of
/// `spacing` from one of them.
template <class Body>
void spread(const Corners& triangle, double spacing, Body&& body) {
  std::vector<Corners> waiting{triangle};
  while (!waiting.empty()) {
    const Corners now = waiting.back();
    waiting.pop_back();
    std::size_t longest = 0;
    double length = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double side = (now[(i + 1) % 3] - now[i]).norm();
      if (side <= length) continue;
      length = side;
      longest = i;
    }
    if (!(length > spacing)) {
      body(Vec3((now[0] + now[1] + now[2]) / 3.0));
      continue;
    }
    const Vec3& a = now[longest];
    const Vec3& b = now[(longest + 1) % 3];
    const Vec3& c = now[(longest + 2) % 3];
    const Vec3 middle = 0.5 * (a + b);
    waiting.push_back({a, middle, c});
    waiting.push_back({middle, b, c});
  }
}

/// The part of a triangle in a box, as a polygon; empty when there is none.
std::vector<Vec3> clipped(const Corners& triangle, const Aabb& box) {
  std::vector<Vec3> polygon(triangle.begin(), triangle.end());
  for (int plane = 0; plane < 6 && !polygon.empty(); ++plane) {
    const int axis = plane / 2;
    const double sign = plane % 2 == 0 ? 1.0 : -1.0;
    const double limit = plane % 2 == 0 ? box.max[axis] : -box.min[axis];
    std::vector<Vec3> kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vec3& from = polygon[i];
      const Vec3& to = polygon[(i + 1) % polygon.size()];
      const double before = limit - sign * from[axis];
      const double after = limit - sign * to[axis];
      if (before >= 0.0) kept.push_back(from);
      if ((before >= 0.0) != (after >= 0.0)) {
        kept.push_back(from + before / (before - after) * (to - from));
      }
    }
    polygon = std::move(kept);
  }
  return polygon;
}

/// Points to find near others.
class PointGrid {
 public:
  explicit PointGrid(double reach) : reach_(reach) {}

  void add(const Vec3& point) {
    cells_[key(cell_of(point))].push_back(point);
    points_.push_back(point);
  }
  bool has_near(const Vec3& point) const {
    const Cell cell = cell_of(point);
    for (std::int64_t i = 0; i < 27; ++i) {
      const auto found = cells_.find(key({cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1,
                                          cell[2] + i / 9 - 1}));
      if (found == cells_.end()) continue;
      for (const Vec3& other : found->second) {
        if ((other - point).squaredNorm() <= reach_ * reach_) return true;
      }
    }
    return false;
  }
  const std::vector<Vec3>& points() const { return points_; }

 private:
  using Cell = std::array<std::int64_t, 3>;

  Cell cell_of(const Vec3& point) const {
    return {std::int64_t(std::floor(point.x() / reach_)),
            std::int64_t(std::floor(point.y() / reach_)),
            std::int64_t(std::floor(point.z() / reach_))};
  }
  /// Cells that share a key are told apart by the distances of their points.
  static std::uint64_t key(const Cell& cell) {
    std::uint64_t packed = 0;
    for (const std::int64_t index : cell) packed = packed << 21 ^ (std::uint64_t(index) & 0x1fffff);
    return packed;
  }

  double reach_;
  std::unordered_map<std::uint64_t, std::vector<Vec3>> cells_;
  std::vector<Vec3> points_;
};

double area_of(const Corners& triangle) {
  return 0.5 * (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).norm();
}

double longest_edge(const Corners& triangle) {
  return std::max({(triangle[1] - triangle[0]).norm(), (triangle[2] - triangle[1]).norm(),
                   (triangle[0] - triangle[2]).norm()});
}

double squared_distance(const Vec3& point, const Corners& triangle) {
  const Vec3 normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
  bool is_above = normal.squaredNorm() > 0.0;
  double nearest = kInfinity;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& start = triangle[i];
    const Vec3 along = triangle[(i + 1) % 3] - start;
    const Vec3 way = point - start;
    if (normal.cross(along).dot(way) < 0.0) is_above = false;
    const double length = along.squaredNorm();
    const double share = length > 0.0 ? std::clamp(way.dot(along) / length, 0.0, 1.0) : 0.0;
    nearest = std::min(nearest, (way - share * along).squaredNorm());
  }
  if (!is_above) return nearest;
  const double height = normal.dot(point - triangle[0]);
  return std::min(nearest, height * height / normal.squaredNorm());
}

/// 1 where the ray leaves through the triangle's front, -1 where it enters there, else 0.
int crossing(const Vec3& start, const Vec3& direction, const Corners& triangle) {
  const Vec3 u = triangle[1] - triangle[0];
  const Vec3 v = triangle[2] - triangle[0];
  const Vec3 p = direction.cross(v);
  const double determinant = u.dot(p);
  if (determinant == 0.0) return 0;
  const Vec3 from = start - triangle[0];
  const double a = from.dot(p) / determinant;
  if (a < 0.0 || a > 1.0) return 0;
  const Vec3 q = from.cross(u);
  const double b = direction.dot(q) / determinant;
  if (b < 0.0 || a + b > 1.0 || v.dot(q) / determinant <= 0.0) return 0;
  // Seen from its front a triangle has a positive determinant.
  return determinant < 0.0 ? 1 : -1;
}

/// Whether a closed surface is around the point, `depth` away or farther: out of it in every
/// direction, so that a bowl without thickness holds nothing inside.
bool is_deep_inside(const Vec3& point, const Surface& solid, double depth) {
  // Askew, so that rays do not run along what is built straight.
  static const std::array<Vec3, 6> kDirections{
      Vec3(0.9, 0.31, 0.17),   Vec3(-0.88, -0.29, 0.23), Vec3(0.27, 0.93, -0.19),
      Vec3(-0.33, -0.91, 0.1), Vec3(0.21, -0.13, 0.95),  Vec3(0.12, 0.26, -0.94)};
  for (const Vec3& direction : kDirections) {
    int left = 0;
    for (const Corners& triangle : solid.triangles) left += crossing(point, direction, triangle);
    if (left <= 0) return false;
  }
  return std::none_of(solid.triangles.begin(), solid.triangles.end(), [&](const auto& triangle) {
    return squared_distance(point, triangle) < depth * depth;
  });
}

class Surfaces {
 public:
  Surfaces(const Scene& scene, NodeId environment, const std::vector<JudgedObject>& objects)
      : scene_(scene) {
    std::map<NodeId, NodeId> owners;
    for (const JudgedObject& object : objects) {
      for (const NodeId node : scene.subtree(object.node)) owners[node] = object.node;
    }
    const Vec3 room =
        environment ? scene.world_bounds(environment).size() : Vec3::Constant(kInfinity);
    for (const NodeId node : scene.subtree(scene.root())) {
      const auto& mesh = scene[node].mesh;
      if (!mesh || mesh->triangles.empty() || !scene.is_visible(node)) continue;
      const auto owner = owners.find(node);
      Surface surface{node, owner == owners.end() ? node : owner->second, {}, false, {}};
      const Affine world_from_mesh = scene.world_from_node(node);
      for (const auto& position : mesh->positions) {
        surface.box.add(Vec3(world_from_mesh * position.cast<double>()));
      }
      const Vec3 size = surface.box.size();
      surface.is_room = size.x() > 0.5 * room.x() && size.y() > 0.5 * room.y();
      all_.push_back(std::move(surface));
    }
  }

  Aabb box_of_owner(NodeId owner) const {
    Aabb box;
    for (const Surface& surface : all_) {
      if (surface.owner == owner) box.add(surface.box);
    }
    return box;
  }
  std::vector<const Surface*> of(NodeId owner) {
    std::vector<const Surface*> found;
    for (Surface& surface : all_) {
      if (surface.owner == owner) found.push_back(&placed(surface));
    }
    return found;
  }
  std::vector<const Surface*> near(const Aabb& box, NodeId except) {
    std::vector<const Surface*> found;
    for (Surface& surface : all_) {
      if (surface.owner != except && overlap(surface.box, box)) found.push_back(&placed(surface));
    }
    return found;
  }

 private:
  Surface& placed(Surface& surface) {
    if (!surface.triangles.empty()) return surface;
    const Affine world_from_mesh = scene_.world_from_node(surface.node);
    const bool is_mirrored = world_from_mesh.linear().determinant() < 0.0;
    const Mesh& mesh = *scene_[surface.node].mesh;
    for (const auto& indices : mesh.triangles) {
      Corners corners;
      for (std::size_t i = 0; i < 3; ++i) {
        corners[i] = world_from_mesh * mesh.positions[indices[i]].cast<double>();
      }
      if (is_mirrored) std::swap(corners[1], corners[2]);
      surface.triangles.push_back(corners);
    }
    return surface;
  }

  const Scene& scene_;
  std::vector<Surface> all_;
};

/// What one object touches and what it is stuck in.
struct Neighbours {
  std::set<NodeId> touched;
  NodeId stuck_in;
};

bool touches(const PointGrid& own, const Surface& other, const Aabb& box, double spacing) {
  bool is_near = false;
  for (const Corners& triangle : other.triangles) {
    if (!overlap(box_of(triangle), box)) continue;
    const std::vector<Vec3> part = clipped(triangle, box);
    for (std::size_t i = 2; i < part.size() && !is_near; ++i) {
      spread({part[0], part[i - 1], part[i]}, spacing,
             [&](const Vec3& point) { is_near = is_near || own.has_near(point); });
    }
    if (is_near) return true;
  }
  return false;
}

bool is_stuck(const std::vector<Vec3>& points, const Surface& other, double depth) {
  constexpr std::size_t kProbes = 256;
  constexpr int kWitnesses = 2;
  const Aabb core = grown(other.box, -depth);
  if (other.is_room || core.is_empty()) return false;
  int deep = 0;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kProbes);
  for (std::size_t i = stride / 2; i < points.size(); i += stride) {
    if (!overlap({points[i], points[i]}, core)) continue;
    if (is_deep_inside(points[i], other, depth) && ++deep == kWitnesses) return true;
  }
  return false;
}

Neighbours neighbours_of(NodeId object, Surfaces& surfaces, const SupportLimits& limits) {
  constexpr double kSpacing = 0.005;  // metres
  constexpr double kMostPoints = 3e5;
  Neighbours found;
  const std::vector<const Surface*> own = surfaces.of(object);
  double area = 0.0;
  double edges = 0.0;
  for (const Surface* part : own) {
    for (const Corners& triangle : part->triangles) {
      area += area_of(triangle);
      edges += longest_edge(triangle);
    }
  }
  // Points of large things are farther apart; what lies between two of them is still near.
  const double spacing =
      std::max({kSpacing, std::sqrt(2.0 * area / kMostPoints), edges / kMostPoints});
  const double reach = limits.reach_m + (spacing - kSpacing);
  PointGrid points(reach);
  for (const Surface* part : own) {
    for (const Corners& triangle : part->triangles) {
      spread(triangle, spacing, [&](const Vec3& point) { points.add(point); });
    }
  }
  const Aabb box = grown(surfaces.box_of_owner(object), reach);
  for (const Surface* other : surfaces.near(box, object)) {
    if (!found.touched.contains(other->owner) && touches(points, *other, box, spacing)) {
      found.touched.insert(other->owner);
    }
    if (!found.stuck_in && is_stuck(points.points(), *other, limits.depth_m)) {
      found.stuck_in = other->owner;
    }
  }
  return found;
}

}  // namespace

std::vector<Flaw> find_unheld(const Scene& scene, NodeId environment,
                              const std::vector<JudgedObject>& objects,
                              const SupportLimits& limits) {
  Surfaces surfaces(scene, environment, objects);
  std::set<NodeId> falling;
  for (const JudgedObject& object : objects) {
    if (object.falls) falling.insert(object.node);
  }
  std::map<NodeId, NodeId> stuck;
  std::map<NodeId, std::vector<NodeId>> touched_by;
  std::set<NodeId> seen, held;
  std::vector<NodeId> ready;
  for (const JudgedObject& object : objects) {
    if (surfaces.box_of_owner(object.node).is_empty()) continue;
    seen.insert(object.node);
    const Neighbours neighbours = neighbours_of(object.node, surfaces, limits);
    if (neighbours.stuck_in) stuck[object.node] = neighbours.stuck_in;
    for (const NodeId other : neighbours.touched) {
      touched_by[other].push_back(object.node);
      if (!falling.contains(other) && held.insert(object.node).second) {
        ready.push_back(object.node);
      }
    }
  }
  while (!ready.empty()) {
    const NodeId holder = ready.back();
    ready.pop_back();
    for (const NodeId object : touched_by[holder]) {
      if (held.insert(object).second) ready.push_back(object);
    }
  }
  std::vector<Flaw> flaws;
  for (const JudgedObject& object : objects) {
    if (const auto in = stuck.find(object.node); in != stuck.end()) {
      flaws.push_back({object.node, "is stuck in " + scene.path(in->second)});
    } else if (object.falls && seen.contains(object.node) && !held.contains(object.node)) {
      flaws.push_back({object.node, "hangs in the air"});
    }
  }
  return flaws;
}

}  // namespace diorama
