// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "diorama/obstacles.h"
#include "diorama/rng.h"
#include "diorama/scene.h"

namespace diorama {

/// The room that a camera has to walk in: nothing visible is nearer than the clearance, nor does
/// anything stand above or below it that may fall.
class WalkSpace {
 public:
  WalkSpace(const Scene& scene, double clearance_m);
  bool holds(const Vec3& place) const;
  /// The same of a line between two places.
  bool holds(const Vec3& from, const Vec3& to) const;
  double clearance_at(const Vec3& place) const;

 private:
  /// How far beyond the clearance everything is; below 0: too near.
  double spare_at(const Vec3& place) const;

  Obstacles obstacles_;
  std::vector<Aabb> falling_;
  double clearance_m_;
};

/// Distance of a place to the boxes of rigid bodies where they are now.
class MovingThings {
 public:
  MovingThings() = default;
  explicit MovingThings(const Scene& scene);
  /// To be called when bodies have moved.
  void look(const Scene& scene);
  double distance(const Vec3& place) const;

 private:
  std::vector<NodeId> bodies_;
  std::vector<Aabb> boxes_;
};

/// Places that lead through the space, as WalkCurve goes along them, for `length_m` or as far as
/// was found in so many draws of a place; at least one, if the space holds any that was drawn.
std::vector<Vec3> plan_walk(const WalkSpace& space, const std::function<Vec3(Rng&)>& draw_place,
                            double length_m, int max_tries, const Rng& rng);

}  // namespace diorama
