// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/support_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
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
  bool is_of_object = false;
  std::vector<Corners> triangles;  ///< World; empty until somebody is near.
};

/// Calls body(point) for points so dense that none of the triangle, as far as it lies in the box,
/// is farther than two thirds of `spacing` from one of them.
template <class Body>
void spread(const Corners& triangle, const Aabb& within, double spacing, Body&& body) {
  std::vector<Corners> waiting{triangle};
  while (!waiting.empty()) {
    const Corners now = waiting.back();
    waiting.pop_back();
    if (!overlap(box_of(now), within)) continue;
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

/// A point of a surface.
struct SurfacePoint {
  Vec3 place;
  bool is_on_wall = false;  ///< The surface is upright there, and nothing can push it up.
};

/// Points to find near others.
class PointGrid {
 public:
  explicit PointGrid(double cell_m) : cell_m_(cell_m) {}

  void add(const SurfacePoint& point) {
    cells_[key(cell_of(point.place))].push_back(points_.size());
    points_.push_back(point);
  }
  /// Calls body(index) for at least the points in the box.
  template <class Body>
  void visit_near(const Aabb& box, Body&& body) const {
    const Cell low = cell_of(box.min);
    const Cell high = cell_of(box.max);
    double cells = 1.0;
    for (std::size_t i = 0; i < 3; ++i) cells *= double(high[i] - low[i] + 1);
    if (cells > double(points_.size())) {
      for (std::size_t i = 0; i < points_.size(); ++i) body(i);
      return;
    }
    Cell cell = low;
    for (cell[0] = low[0]; cell[0] <= high[0]; ++cell[0]) {
      for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1]) {
        for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2]) {
          const auto found = cells_.find(key(cell));
          if (found == cells_.end()) continue;
          for (const std::size_t i : found->second) body(i);
        }
      }
    }
  }
  const std::vector<SurfacePoint>& points() const { return points_; }

 private:
  using Cell = std::array<std::int64_t, 3>;

  Cell cell_of(const Vec3& point) const {
    return {std::int64_t(std::floor(point.x() / cell_m_)),
            std::int64_t(std::floor(point.y() / cell_m_)),
            std::int64_t(std::floor(point.z() / cell_m_))};
  }
  /// Cells may share a key.
  static std::uint64_t key(const Cell& cell) {
    std::uint64_t packed = 0;
    for (const std::int64_t index : cell) packed = packed << 21 ^ (std::uint64_t(index) & 0x1fffff);
    return packed;
  }

  double cell_m_;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> cells_;  ///< Indices.
  std::vector<SurfacePoint> points_;
};

double area_of(const Corners& triangle) {
  return 0.5 * (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).norm();
}

double longest_edge(const Corners& triangle) {
  return std::max({(triangle[1] - triangle[0]).norm(), (triangle[2] - triangle[1]).norm(),
                   (triangle[0] - triangle[2]).norm()});
}

/// The way to the point from where the triangle is nearest to it.
Vec3 way_from(const Corners& triangle, const Vec3& point) {
  const Vec3 normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
  bool is_above = normal.squaredNorm() > 0.0;
  Vec3 shortest = point - triangle[0];
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& start = triangle[i];
    const Vec3 along = triangle[(i + 1) % 3] - start;
    const Vec3 way = point - start;
    if (normal.cross(along).dot(way) < 0.0) is_above = false;
    const double length = along.squaredNorm();
    const double share = length > 0.0 ? std::clamp(way.dot(along) / length, 0.0, 1.0) : 0.0;
    const Vec3 from_edge = way - share * along;
    if (from_edge.squaredNorm() < shortest.squaredNorm()) shortest = from_edge;
  }
  if (!is_above) return shortest;
  return normal.dot(point - triangle[0]) / normal.squaredNorm() * normal;
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
/// direction, so that a bowl without thickness holds nothing inside. Furniture often has no
/// underside: what stands fast may be open there.
bool is_deep_inside(const Vec3& point, const Surface& solid, double depth) {
  constexpr double kDown = -0.5;
  // Askew, so that rays do not run along what is built straight.
  static const std::array<Vec3, 6> kDirections{Vec3(0.9, 0.31, 0.17),   Vec3(-0.88, -0.29, 0.23),
                                               Vec3(0.27, 0.93, -0.19), Vec3(-0.33, -0.91, 0.1),
                                               Vec3(0.21, -0.13, 0.95), Vec3(0.12, 0.26, -0.94)};
  int sense = 0;  // of the faces: some things are inside out
  for (const Vec3& direction : kDirections) {
    int left = 0;
    for (const Corners& triangle : solid.triangles) left += crossing(point, direction, triangle);
    if (left == 0 && direction.z() < kDown && !solid.is_of_object) continue;
    if (left == 0 || left * sense < 0) return false;
    sense = left;
  }
  return std::none_of(solid.triangles.begin(), solid.triangles.end(), [&](const auto& triangle) {
    return way_from(triangle, point).squaredNorm() < depth * depth;
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
      const bool is_of_object = owner != owners.end();
      Surface surface{node, is_of_object ? owner->second : node, {}, false, is_of_object, {}};
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

/// What may hold one object, and what it is stuck in.
struct Neighbours {
  std::set<NodeId> holders;
  NodeId stuck_in;
};

double lean_of(const Corners& triangle) {
  const Vec3 normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
  return normal.squaredNorm() > 0.0 ? std::abs(normal.z()) / normal.norm() : 0.0;
}

/// Whether the thing lies below the point of its surface and not above it: nothing can push it up
/// there. Sheets lie neither below nor above.
bool is_on_top(const Vec3& point, const std::vector<const Surface*>& own) {
  // Askew, and off the surface that the point is on.
  static const Vec3 kUp = Vec3(0.013, 0.007, 1.0).normalized();
  constexpr double kSkin = 1e-4;  // metres
  const auto is_crossed = [&](const Vec3& direction) {
    return std::ranges::any_of(own, [&](const Surface* part) {
      return std::ranges::any_of(part->triangles, [&](const Corners& triangle) {
        return crossing(point + kSkin * direction, direction, triangle) != 0;
      });
    });
  };
  return !is_crossed(kUp) && is_crossed(-kUp);
}

/// Whether the other could hold what the points are of: nearer than this to one that it could push
/// up, below it, or no wall and sunk into or too near to tell.
bool may_hold(const Surface& other, const PointGrid& points, const std::vector<const Surface*>& own,
              const Aabb& box, double reach) {
  constexpr double kTooNear = 0.004;  // metres; points are 5 mm apart
  constexpr double kBelow = 0.25;     // sine of the angle to the level: of ways and of surfaces
  struct Nearest {
    Vec3 way;
    double lean = 0.0;  ///< Of the triangle; 0: upright.
  };
  std::map<std::size_t, Nearest> nearest;  // by point
  for (const Corners& triangle : other.triangles) {
    const Aabb around = grown(box_of(triangle), reach);
    if (!overlap(around, box)) continue;
    const double lean = lean_of(triangle);
    const Aabb both{around.min.cwiseMax(box.min), around.max.cwiseMin(box.max)};
    points.visit_near(both, [&](std::size_t point) {
      if (points.points()[point].is_on_wall) return;
      const Vec3 way = way_from(triangle, points.points()[point].place);
      if (way.squaredNorm() > reach * reach) return;
      const auto [known, is_new] = nearest.emplace(point, Nearest{way, lean});
      if (!is_new && way.squaredNorm() < known->second.way.squaredNorm()) {
        known->second = {way, lean};
      }
    });
  }
  return std::ranges::any_of(nearest, [&](const auto& entry) {
    const auto& [point, found] = entry;
    const double distance = found.way.norm();
    const bool is_under = found.way.z() >= kBelow * distance && distance > 0.0;
    const bool is_dented = found.way.z() < 0.0 || distance <= kTooNear;
    return (is_under || (is_dented && found.lean >= kBelow)) &&
           !is_on_top(points.points()[point].place, own);
  });
}

/// Whether points are deep inside of a solid thing.
bool is_any_deep(const std::vector<Vec3>& points, const Surface& solid, double depth) {
  constexpr std::size_t kProbes = 256;
  constexpr int kWitnesses = 2;
  int deep = 0;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kProbes);
  for (std::size_t i = stride / 2; i < points.size(); i += stride) {
    if (is_deep_inside(points[i], solid, depth) && ++deep == kWitnesses) return true;
  }
  return false;
}

/// Whether one is deep inside of the other, or the other, thin as it may be, goes through it.
bool is_stuck(const std::vector<SurfacePoint>& points, const std::vector<const Surface*>& own,
              const Surface& other, double spacing, double depth) {
  if (other.is_room) return false;
  std::vector<Vec3> reaching;
  const Aabb core = grown(other.box, -depth);
  for (const SurfacePoint& point : points) {
    if (!core.is_empty() && overlap({point.place, point.place}, core)) {
      reaching.push_back(point.place);
    }
  }
  if (is_any_deep(reaching, other, depth)) return true;
  // Of two objects, the other one is asked as well.
  if (other.is_of_object) return false;
  return std::ranges::any_of(own, [&](const Surface* part) {
    const Aabb inner = grown(part->box, -depth);
    if (inner.is_empty() || !overlap(inner, other.box)) return false;
    std::vector<Vec3> through;
    for (const Corners& triangle : other.triangles) {
      spread(triangle, inner, spacing, [&](const Vec3& place) {
        if (overlap({place, place}, inner)) through.push_back(place);
      });
    }
    return is_any_deep(through, *part, depth);
  });
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
      const Vec3 normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
      const bool is_on_wall = std::abs(normal.z()) < 0.1 * normal.norm();
      spread(triangle, part->box, spacing, [&](const Vec3& place) {
        points.add({place, is_on_wall});
      });
    }
  }
  const Aabb box = grown(surfaces.box_of_owner(object), reach);
  for (const Surface* other : surfaces.near(box, object)) {
    if (!found.holders.contains(other->owner) && may_hold(*other, points, own, box, reach)) {
      found.holders.insert(other->owner);
    }
    if (!found.stuck_in && is_stuck(points.points(), own, *other, spacing, limits.depth_m)) {
      found.stuck_in = other->owner;
    }
  }
  return found;
}

/// The share of all directions in which the surface is seen from the point.
double share_around(const Vec3& point, const Surface& surface) {
  constexpr int kRays = 96;
  const double turn = kPi * (3.0 - std::sqrt(5.0));
  int met = 0;
  for (int i = 0; i < kRays; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / kRays;
    const double flat = std::sqrt(1.0 - z * z);
    const Vec3 direction(flat * std::cos(turn * i), flat * std::sin(turn * i), z);
    met += std::ranges::any_of(surface.triangles, [&](const Corners& triangle) {
      return crossing(point, direction, triangle) != 0;
    });
  }
  return double(met) / kRays;
}

std::string why_blocked(const Scene& scene, const JudgedCamera& camera,
                        const std::vector<const Surface*>& near) {
  // A shade that is open at both ends fills about two thirds, a shelf five sixths; a table top over
  // a camera less than half.
  constexpr double kInside = 0.6;
  double nearest = camera.near_m;
  const Surface* too_near = nullptr;
  for (const Surface* surface : near) {
    const bool is_within = !surface->is_room && overlap({camera.place, camera.place}, surface->box);
    if (is_within && share_around(camera.place, *surface) >= kInside) {
      return "stands in " + scene.path(surface->node);
    }
    for (const Corners& triangle : surface->triangles) {
      const double distance = way_from(triangle, camera.place).norm();
      if (distance >= nearest) continue;
      nearest = distance;
      too_near = surface;
    }
  }
  if (!too_near) return "";
  char text[48];
  std::snprintf(text, sizeof text, "is %.3f m from ", nearest);
  return text + scene.path(too_near->node);
}

}  // namespace

std::vector<std::string> find_blocked(const Scene& scene, NodeId environment,
                                      const std::vector<JudgedCamera>& cameras) {
  Surfaces surfaces(scene, environment, {});
  std::vector<std::string> reasons;
  for (const JudgedCamera& camera : cameras) {
    const Aabb around = grown({camera.place, camera.place}, camera.near_m);
    reasons.push_back(why_blocked(scene, camera, surfaces.near(around, {})));
  }
  return reasons;
}

std::vector<Flaw> find_unheld(const Scene& scene, NodeId environment,
                              const std::vector<JudgedObject>& objects,
                              const SupportLimits& limits) {
  Surfaces surfaces(scene, environment, objects);
  std::set<NodeId> falling;
  for (const JudgedObject& object : objects) {
    if (object.falls) falling.insert(object.node);
  }
  std::map<NodeId, NodeId> stuck;
  std::map<NodeId, std::vector<NodeId>> held_by;
  std::set<NodeId> seen, held;
  std::vector<NodeId> ready;
  for (const JudgedObject& object : objects) {
    if (surfaces.box_of_owner(object.node).is_empty()) continue;
    seen.insert(object.node);
    const Neighbours neighbours = neighbours_of(object.node, surfaces, limits);
    if (neighbours.stuck_in) stuck[object.node] = neighbours.stuck_in;
    for (const NodeId other : neighbours.holders) {
      held_by[other].push_back(object.node);
      if (!falling.contains(other) && held.insert(object.node).second) {
        ready.push_back(object.node);
      }
    }
  }
  while (!ready.empty()) {
    const NodeId holder = ready.back();
    ready.pop_back();
    for (const NodeId object : held_by[holder]) {
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
