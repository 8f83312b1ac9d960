// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "diorama/rng.h"
#include "diorama/scene.h"

namespace diorama {

/// The triangles of some nodes that face upwards, to draw points from evenly by area.
class SurfacePoints {
 public:
  /// Takes visible meshes at the nodes that fit. `max_slope_rad` is off the horizontal.
  SurfacePoints(const Scene& scene, std::string_view pattern, double max_slope_rad);

  bool is_empty() const { return triangles_.empty(); }
  /// In the world. Not when it is empty.
  Vec3 draw(Rng& rng) const;

 private:
  struct Triangle {
    Vec3 corner, edge_a, edge_b;  // world
    double area_so_far = 0.0;     // of all triangles up to and including this one
  };
  std::vector<Triangle> triangles_;
};

}  // namespace diorama
