// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// What a segment met first.
struct ObstacleHit {
  double t = 0.0;  ///< Where on the segment: 0 is its start, 1 its end.
  NodeId owner;
  bool is_leaving = false;  ///< The triangle's front faces along the segment.
};

/// The triangles of some nodes as they stand now, to ask what is where. Each question may name one
/// of the nodes that is not to count. Trees over the triangles are built when a mesh is first asked
/// about and are kept for other objects of this class while the mesh lives. Main thread only; the
/// scene need not outlive it.
class DIORAMA_SDK_API Obstacles {
 public:
  enum class Hidden : std::uint8_t { LeaveOut, Count };

  /// Meshes at and below the owners. One that is found below two owners belongs to the first.
  Obstacles(const Scene& scene, std::span<const NodeId> owners, Hidden hidden);
  /// The visible meshes at the nodes that fit the pattern, which own themselves.
  Obstacles(const Scene& scene, std::string_view pattern);
  ~Obstacles();
  Obstacles(Obstacles&&) noexcept;
  Obstacles& operator=(Obstacles&&) noexcept;

  /// Adds the meshes at and below one more owner.
  void add(const Scene& scene, NodeId owner, Hidden hidden);

  /// A triangle crosses the segment.
  bool is_between(const Vec3& from_world, const Vec3& to_world, NodeId except = {}) const;
  std::optional<ObstacleHit> first_hit(const Vec3& from_world, const Vec3& to_world,
                                       NodeId except = {}) const;
  /// To the nearest triangle, in metres; `limit_m` when none is nearer.
  double distance(const Vec3& point_world, double limit_m, NodeId except = {}) const;
  bool is_near(const Vec3& point_world, double distance_m, NodeId except = {}) const {
    return distance(point_world, distance_m, except) < distance_m;
  }
  /// A triangle reaches into the box.
  bool meets_box(const Aabb& box, const Affine& world_from_box, NodeId except = {}) const;
  /// Owners that come as near as `distance_m` to the triangles of `node` and those below it; 0:
  /// that touch or cross them. Each once, in no order of meaning.
  std::vector<NodeId> near_node(const Scene& scene, NodeId node, double distance_m,
                                NodeId except = {}) const;
  /// The owner of a closed mesh that the point lies in; null: none. What spans half of all that
  /// stands fast, or more, is a room or a sky, in which things may be.
  NodeId encloser(const Vec3& point_world, NodeId except = {}) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Rigid bodies that nobody has placed: objects wait at their parent's origin until a randomizer
/// gives them a place, and are in nobody's way until then.
DIORAMA_SDK_API std::vector<NodeId> unplaced_bodies(const Scene& scene);

}  // namespace diorama
