// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/settle_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "diorama/obstacles.h"
#include "framework/pipeline/settling.h"

namespace diorama {
namespace {

/// All meshes of a scene: those of an object belong to it, all others to themselves.
Obstacles all_obstacles(const Scene& scene, const std::vector<NodeId>& objects,
                        Obstacles::Hidden hidden) {
  Obstacles all(scene, objects, hidden);
  for (const NodeId node : scene.subtree(scene.root())) {
    if (scene[node].mesh) all.add(scene, node, hidden);
  }
  return all;
}

/// The way through an object from a point of its surface, against the normal.
struct Chord {
  Vec3 start, direction;
  double length = 0.0;
};

struct Triangle {
  std::array<Vec3, 3> corner;
  Vec3 normal;  ///< Length: twice the area.
};

std::vector<Triangle> triangles_of(const Scene& scene, NodeId object) {
  std::vector<Triangle> triangles;
  for (const NodeId node : scene.subtree(object)) {
    const auto& mesh = scene[node].mesh;
    if (!mesh || !scene.is_visible(node)) continue;
    const Affine world_from_mesh = scene.world_from_node(node);
    const double side = world_from_mesh.linear().determinant() < 0.0 ? -1.0 : 1.0;
    for (const auto& indices : mesh->triangles) {
      Triangle triangle;
      for (std::size_t i = 0; i < 3; ++i) {
        triangle.corner[i] = world_from_mesh * mesh->positions[indices[i]].cast<double>();
      }
      triangle.normal =
          side *
          (triangle.corner[1] - triangle.corner[0]).cross(triangle.corner[2] - triangle.corner[0]);
      triangles.push_back(triangle);
    }
  }
  return triangles;
}

/// Calls body(point, normal) for points that are spread evenly over the surface.
template <class Body>
void spread_over(const std::vector<Triangle>& triangles, int points, Body&& body) {
  double area = 0.0;
  for (const Triangle& triangle : triangles) area += triangle.normal.norm();
  if (area <= 0.0) return;
  double passed = 0.0;
  int point = 0;
  for (const Triangle& triangle : triangles) {
    passed += triangle.normal.norm();
    for (; point < points && area * (point + 0.5) < passed * points; ++point) {
      double u = std::fmod(0.5 + 0.7548776662466927 * point, 1.0);
      double v = std::fmod(0.5 + 0.5698402909980532 * point, 1.0);
      if (u + v > 1.0) {
        u = 1.0 - u;
        v = 1.0 - v;
      }
      const auto& [a, b, c] = triangle.corner;
      body(Vec3(a + u * (b - a) + v * (c - a)), Vec3(triangle.normal.normalized()));
    }
  }
}

std::vector<Chord> chords_of(const Scene& scene, NodeId object) {
  constexpr int kPoints = 96;
  constexpr double kSkin = 1e-5;  // metres; off the triangle that the chord starts from
  const Obstacles own(scene, std::span(&object, 1), Obstacles::Hidden::LeaveOut);
  const double reach = 2.0 * scene.world_bounds(object).size().norm();
  std::vector<Chord> chords;
  spread_over(triangles_of(scene, object), kPoints, [&](const Vec3& point, const Vec3& normal) {
    const Vec3 start = point - kSkin * normal;
    const auto exit = own.first_hit(start, start - reach * normal);
    if (exit && exit->is_leaving) chords.push_back({start, -normal, exit->t * reach});
  });
  return chords;
}

/// What some of the object's surface is deep inside of, little as it may be: the rim of a can in a
/// table top. Null: nothing.
NodeId sunk_in(const Scene& scene, NodeId object, const Obstacles& all, double depth_m) {
  constexpr int kPoints = 8192;
  constexpr int kWitnesses = 2;
  std::vector<Aabb> cores;
  for (const NodeId other : all.near_node(scene, object, 0.0, object)) {
    Aabb core = scene.world_bounds(other);
    core.min.array() += depth_m;
    core.max.array() -= depth_m;
    if (!core.is_empty()) cores.push_back(core);
  }
  if (cores.empty()) return {};
  std::map<NodeId, int> deep;
  NodeId found;
  spread_over(triangles_of(scene, object), kPoints, [&](const Vec3& point, const Vec3&) {
    const bool is_possible = !found && std::ranges::any_of(cores, [&](const Aabb& core) {
      return (point.array() > core.min.array()).all() && (point.array() < core.max.array()).all();
    });
    if (!is_possible || all.is_near(point, depth_m, object)) return;
    const NodeId encloser = all.encloser(point, object);
    if (encloser && ++deep[encloser] >= kWitnesses) found = encloser;
  });
  return found;
}

/// What crosses the object deep inside, or holds its middle; null: nothing.
NodeId stuck_in(const Scene& scene, NodeId object, const Obstacles& all,
                const SettleLimits& limits) {
  // A single chord may graze an edge.
  constexpr int kWitnesses = 2;
  std::map<NodeId, int> crossed;
  bool is_first = true;
  for (const Chord& chord : chords_of(scene, object)) {
    const Vec3 middle = chord.start + 0.5 * chord.length * chord.direction;
    if (std::exchange(is_first, false)) {
      if (const NodeId encloser = all.encloser(middle, object)) return encloser;
    }
    const double skin = std::min(limits.depth_m, std::max(0.35 * chord.length, 0.006));
    if (chord.length <= 2.0 * skin) continue;
    const auto hit = all.first_hit(chord.start + skin * chord.direction,
                                   chord.start + (chord.length - skin) * chord.direction, object);
    if (hit && ++crossed[hit->owner] >= kWitnesses) return hit->owner;
  }
  return sunk_in(scene, object, all, limits.depth_m);
}

std::optional<Flaw> stuck_flaw(const Scene& scene, NodeId object, const Obstacles& all,
                               const SettleLimits& limits) {
  const NodeId other = stuck_in(scene, object, all, limits);
  if (!other) return std::nullopt;
  return Flaw{object, "is stuck in " + scene.path(other)};
}

/// Whether the surface that a column met there is as good as a wall: what is above it slides past.
bool is_upright(const Obstacles& others, const Vec3& met) {
  constexpr double kAbove = 2e-4;  // metres
  constexpr double kLean = 0.25;   // sine of the surface's normal over the level
  // Right above a plane the way to it is the shorter the steeper it is.
  return others.distance(met + kAbove * Vec3::UnitZ(), kAbove) < kLean * kAbove;
}

/// What could hold the object up, of `near`: what lies below it somewhere, within reach. What it
/// merely leans against holds nothing, steep as it may be. Columns are tried all over its outline,
/// those of its corners as well: a thing may stand on one. Ends with the first for which
/// `is_enough` holds.
std::set<NodeId> found_below(const Scene& scene, NodeId object, const std::vector<NodeId>& near,
                             const SettleLimits& limits,
                             const std::function<bool(NodeId)>& is_enough) {
  constexpr int kColumns = 2048;
  constexpr std::size_t kTriangles = 512;
  constexpr int kFloors = 8;       // of one column: a cup by its handle
  constexpr double kSkin = 1e-5;   // metres; off what a segment has met
  constexpr double kInset = 5e-4;  // metres; a corner's own column may pass it by
  const Obstacles own(scene, std::span(&object, 1), Obstacles::Hidden::LeaveOut);
  const Obstacles others(scene, near, Obstacles::Hidden::LeaveOut);
  const Aabb box = scene.world_bounds(object);
  const Vec3 size = box.size();
  std::set<NodeId> below;
  const auto finds_enough = [&](double x, double y) {
    double z = box.min.z() - kSkin;
    const double top = box.max.z() + kSkin;
    for (int floor = 0; floor < kFloors; ++floor) {
      const auto entry = own.first_hit({x, y, z}, {x, y, top});
      if (!entry) return false;
      const double underside = z + entry->t * (top - z);
      const auto exit = own.first_hit({x, y, underside + kSkin}, {x, y, top});
      const double inside = exit ? kSkin + exit->t * (top - underside - kSkin) : kInfinity;
      // It may have sunk in, but what lies on a thin thing does not hold it.
      const double start = underside + std::min(limits.depth_m, inside);
      const double end = underside - limits.reach_m;
      const auto hit = others.first_hit({x, y, start}, {x, y, end});
      if (hit && !is_upright(others, {x, y, start + hit->t * (end - start)})) {
        below.insert(hit->owner);
        if (is_enough(hit->owner)) return true;
      }
      if (!exit) return false;
      z = underside + inside + kSkin;
    }
    return false;
  };
  for (int i = 0; i < kColumns; ++i) {
    const double x = box.min.x() + size.x() * std::fmod(0.5 + 0.7548776662466927 * i, 1.0);
    const double y = box.min.y() + size.y() * std::fmod(0.5 + 0.5698402909980532 * i, 1.0);
    if (finds_enough(x, y)) return below;
  }
  const std::vector<Triangle> triangles = triangles_of(scene, object);
  const auto finds_enough_at = [&](const Triangle& triangle) {
    const auto& corners = triangle.corner;
    const Vec3 middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    return std::ranges::any_of(corners, [&](const Vec3& corner) {
      const Vec3 way = middle - corner;
      const Vec3 inner = corner + std::min(1.0, kInset / std::max(way.norm(), kInset)) * way;
      return finds_enough(inner.x(), inner.y());
    });
  };
  // The lowest first: a thing on thin feet stands on these.
  std::vector<std::pair<double, std::size_t>> lowest;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const auto& [a, b, c] = triangles[i].corner;
    lowest.emplace_back(std::min({a.z(), b.z(), c.z()}), i);
  }
  const std::size_t count = std::min(kTriangles, lowest.size());
  std::ranges::partial_sort(lowest, lowest.begin() + std::ptrdiff_t(count));
  lowest.resize(count);
  for (const auto& [z, i] : lowest) {
    if (finds_enough_at(triangles[i])) return below;
  }
  const std::size_t stride = std::max<std::size_t>(1, triangles.size() / kTriangles);
  for (std::size_t i = 0; i < triangles.size(); i += stride) {
    if (finds_enough_at(triangles[i])) return below;
  }
  return below;
}

/// Objects that something holds up: what is no object or floats lies below them, or one that is
/// held up.
std::set<NodeId> supported(const Scene& scene, const std::vector<NodeId>& objects,
                           const Obstacles& all, const SettleLimits& limits) {
  const auto falls = [&](NodeId node) {
    return scene[node].rigid_body && scene[node].rigid_body->has_gravity;
  };
  const std::set<NodeId> known(objects.begin(), objects.end());
  const auto stands = [&](NodeId node) { return !known.contains(node) || !falls(node); };
  std::map<NodeId, std::vector<NodeId>> lies_on;
  std::vector<NodeId> ready;
  std::set<NodeId> held;
  for (const NodeId object : objects) {
    if (!falls(object)) continue;
    const std::vector<NodeId> near = all.near_node(scene, object, limits.reach_m, object);
    if (near.empty()) continue;
    for (const NodeId other : found_below(scene, object, near, limits, stands)) {
      lies_on[other].push_back(object);
      if (stands(other) && held.insert(object).second) ready.push_back(object);
    }
  }
  while (!ready.empty()) {
    const NodeId holder = ready.back();
    ready.pop_back();
    for (const NodeId object : lies_on[holder]) {
      if (held.insert(object).second) ready.push_back(object);
    }
  }
  return held;
}

std::string speed_text(double speed) {
  char text[48];
  std::snprintf(text, sizeof text, "moves at %.2f m/s", speed);
  return text;
}

}  // namespace

std::vector<Flaw> find_unsettled(const Scene& scene, const Room& room,
                                 const std::vector<NodeId>& objects, const LastStep& last,
                                 const SettleLimits& limits) {
  const Obstacles all = all_obstacles(scene, objects, Obstacles::Hidden::LeaveOut);
  const std::set<NodeId> held = supported(scene, objects, all, limits);
  std::vector<Flaw> flaws;
  for (const NodeId object : objects) {
    const auto& body = scene[object].rigid_body;
    const bool falls = body && body->has_gravity;
    const bool is_seen = !node_bounds(scene, object).is_empty();
    if (!room.holds(scene, object)) {
      flaws.push_back({object, "left the room"});
    } else if (const double speed = falls ? speed_of(scene, object, last) : 0.0;
               speed > limits.rest_speed) {
      flaws.push_back({object, speed_text(speed)});
    } else if (const auto stuck = stuck_flaw(scene, object, all, limits)) {
      flaws.push_back(*stuck);
    } else if (falls && is_seen && !held.contains(object)) {
      flaws.push_back({object, "hangs in the air"});
    }
  }
  return flaws;
}

std::vector<Flaw> find_stuck(const Scene& scene, const std::vector<NodeId>& objects,
                             const std::vector<NodeId>& asked, const SettleLimits& limits) {
  std::vector<Flaw> flaws;
  if (asked.empty()) return flaws;
  const Obstacles all = all_obstacles(scene, objects, Obstacles::Hidden::LeaveOut);
  for (const NodeId object : asked) {
    if (const auto stuck = stuck_flaw(scene, object, all, limits)) flaws.push_back(*stuck);
  }
  return flaws;
}

std::vector<Flaw> find_born_inside(const Scene& scene, const std::vector<NodeId>& objects) {
  const Obstacles all = all_obstacles(scene, objects, Obstacles::Hidden::Count);
  std::vector<Flaw> flaws;
  for (const NodeId object : objects) {
    const Aabb box = scene.world_bounds(object);
    if (box.is_empty()) continue;
    NodeId other = all.encloser(box.centre(), object);
    if (!other) {
      const std::vector<NodeId> met = all.near_node(scene, object, 0.0, object);
      if (!met.empty()) other = met.front();
    }
    if (other) flaws.push_back({object, "starts in " + scene.path(other)});
  }
  return flaws;
}

std::vector<Flaw> find_blocked_cameras(const Scene& scene, const std::vector<NodeId>& cameras) {
  const Obstacles all(scene, "/**");
  std::vector<Flaw> flaws;
  for (const NodeId camera : cameras) {
    const Vec3 place = scene.world_from_node(camera).translation();
    const double near_m = scene[camera].camera ? scene[camera].camera->near_m : 0.0;
    if (const NodeId encloser = all.encloser(place)) {
      flaws.push_back({camera, "stands in " + scene.path(encloser)});
    } else if (const double distance = all.distance(place, near_m); distance < near_m) {
      char text[64];
      std::snprintf(text, sizeof text, "is %.3f m from something", distance);
      flaws.push_back({camera, text});
    }
  }
  return flaws;
}

}  // namespace diorama
