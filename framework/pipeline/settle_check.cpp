// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/settle_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
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

/// Chords from points that are spread evenly over the surface.
std::vector<Chord> chords_of(const Scene& scene, NodeId object) {
  constexpr int kPoints = 96;
  constexpr double kSkin = 1e-5;  // metres; off the triangle that the chord starts from
  const std::vector<Triangle> triangles = triangles_of(scene, object);
  double area = 0.0;
  for (const Triangle& triangle : triangles) area += triangle.normal.norm();
  if (area <= 0.0) return {};
  const Obstacles own(scene, std::span(&object, 1), Obstacles::Hidden::LeaveOut);
  const double reach = 2.0 * scene.world_bounds(object).size().norm();
  std::vector<Chord> chords;
  double passed = 0.0;
  int point = 0;
  for (const Triangle& triangle : triangles) {
    passed += triangle.normal.norm();
    for (; point < kPoints && area * (point + 0.5) < passed * kPoints; ++point) {
      double u = std::fmod(0.5 + 0.7548776662466927 * point, 1.0);
      double v = std::fmod(0.5 + 0.5698402909980532 * point, 1.0);
      if (u + v > 1.0) {
        u = 1.0 - u;
        v = 1.0 - v;
      }
      const auto& [a, b, c] = triangle.corner;
      Chord chord;
      chord.direction = -triangle.normal.normalized();
      chord.start = a + u * (b - a) + v * (c - a) + kSkin * chord.direction;
      const auto exit = own.first_hit(chord.start, chord.start + reach * chord.direction);
      if (!exit || !exit->is_leaving) continue;
      chord.length = exit->t * reach;
      chords.push_back(chord);
    }
  }
  return chords;
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
  return {};
}

/// Objects that something holds up: they touch what is no object or floats, or one that is held up.
std::set<NodeId> supported(const Scene& scene, const std::vector<NodeId>& objects,
                           const Obstacles& all, double reach_m) {
  const auto falls = [&](NodeId node) {
    return scene[node].rigid_body && scene[node].rigid_body->has_gravity;
  };
  const std::set<NodeId> known(objects.begin(), objects.end());
  std::map<NodeId, std::vector<NodeId>> touched_by;
  std::vector<NodeId> ready;
  std::set<NodeId> held;
  for (const NodeId object : objects) {
    if (!falls(object)) continue;
    for (const NodeId other : all.near_node(scene, object, reach_m, object)) {
      touched_by[other].push_back(object);
      const bool stands = !known.contains(other) || !falls(other);
      if (stands && held.insert(object).second) ready.push_back(object);
    }
  }
  while (!ready.empty()) {
    const NodeId holder = ready.back();
    ready.pop_back();
    for (const NodeId object : touched_by[holder]) {
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
  const std::set<NodeId> held = supported(scene, objects, all, limits.reach_m);
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
    } else if (const NodeId other = stuck_in(scene, object, all, limits)) {
      flaws.push_back({object, "is stuck in " + scene.path(other)});
    } else if (falls && is_seen && !held.contains(object)) {
      flaws.push_back({object, "hangs in the air"});
    }
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
