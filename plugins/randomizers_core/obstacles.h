// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// The visible triangles of some nodes as they stand now, to ask whether a view is free. Boxes are
/// culled, triangles are not indexed: meant for some hundred questions.
class Obstacles {
 public:
  Obstacles(const Scene& scene, std::string_view pattern);

  /// A triangle crosses the segment.
  bool is_between(const Vec3& from_world, const Vec3& to_world) const;
  /// A triangle comes nearer to the point than `distance_m`.
  bool is_near(const Vec3& point_world, double distance_m) const;

 private:
  struct Item {
    std::shared_ptr<const Mesh> mesh;
    Affine world_from_mesh;
    Affine mesh_from_world;
    Aabb box_mesh;
    Aabb box_world;
  };
  std::vector<Item> items_;
};

}  // namespace diorama
