// SPDX-License-Identifier: Apache-2.0
#include "sampling.h"

#include <sstream>

#include "diorama/error.h"

namespace diorama {

Vec3 draw_between(const Vec3& min, const Vec3& max, Rng& rng) {
  Vec3 value;
  for (int axis = 0; axis < 3; ++axis) value[axis] = rng.uniform(min[axis], max[axis]);
  return value;
}

double draw_in(const Range& range, Rng& rng) { return rng.uniform(range.lo, range.hi); }

void check_corners(const Vec3& min, const Vec3& max, std::string_view min_key,
                   std::string_view max_key) {
  if ((min.array() <= max.array()).all()) return;
  std::ostringstream text;
  text << min_key << " must not exceed " << max_key << ": found [" << min.x() << ", " << min.y()
       << ", " << min.z() << "] and [" << max.x() << ", " << max.y() << ", " << max.z() << "]";
  throw Error(ErrorKind::Config, text.str());
}

void set_world_pose(Scene& scene, NodeId node, const Affine& world_from_node) {
  const Affine world_from_parent = scene.world_from_node(scene[node].parent);
  scene.set_pose(node, world_from_parent.inverse() * world_from_node);
}

}  // namespace diorama
