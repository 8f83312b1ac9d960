// SPDX-License-Identifier: Apache-2.0
#include "writer_support/cuboid.h"

#include <cmath>

namespace diorama {

bool has_extent(const Instance& instance) {
  const Aabb& bounds = instance.bounds_node;
  return !bounds.is_empty() && !bounds.size().isZero(0.0);
}

bool has_pose(const Instance& instance) {
  return has_extent(instance) || instance.world_from_node.matrix() != Affine::Identity().matrix();
}

void add_pose(const Instance& instance, Json& object) {
  if (!has_pose(instance)) return;
  object["world_from_node"] = nested_list(instance.world_from_node.matrix());
  if (!has_extent(instance)) return;
  object["bounds_min"] = flat_list(instance.bounds_node.min.transpose());
  object["bounds_max"] = flat_list(instance.bounds_node.max.transpose());
}

Vec3 keypoint_in_box(const Aabb& box, const CuboidPoint& keypoint) {
  Vec3 point = box.centre();
  for (int axis = 0; axis < 3; ++axis) {
    if (keypoint.side[std::size_t(axis)] < 0) point[axis] = box.min[axis];
    if (keypoint.side[std::size_t(axis)] > 0) point[axis] = box.max[axis];
  }
  return point;
}

ImagePoint image_point(const Frame& frame, const Vec3& point_world) {
  const Vec3 point = frame.world_from_camera.inverse() * point_world;
  const std::optional<Vec2> pixel = project(frame.camera, point);
  const auto& distances = frame.get(kDistanceToCamera);
  if (!pixel || !(pixel->array() >= 0.0).all() || pixel->x() >= distances.width() ||
      pixel->y() >= distances.height()) {
    return {};
  }
  const float surface = distances.at(int(pixel->x()), int(pixel->y()));
  const bool is_visible = surface >= 0.99 * point.norm();
  return {is_visible ? ImagePoint::State::Visible : ImagePoint::State::Hidden, *pixel};
}

}  // namespace diorama
