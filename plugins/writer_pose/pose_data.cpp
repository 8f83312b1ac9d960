// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/pose_data.h"

#include <algorithm>
#include <cmath>

#include "writer_pose/replicator_projection.h"
#include "writer_support/camera_matrices.h"

namespace diorama {
namespace {

constexpr KeypointOrder kDope{{{"LUF", {-1, 1, 1}},
                               {"RUF", {1, 1, 1}},
                               {"RDF", {1, -1, 1}},
                               {"LDF", {-1, -1, 1}},
                               {"LUB", {-1, 1, -1}},
                               {"RUB", {1, 1, -1}},
                               {"RDB", {1, -1, -1}},
                               {"LDB", {-1, -1, -1}},
                               {"Center", {0, 0, 0}}}};

Vec3 mapped(const Mat4& row_vector_matrix, const Vec3& point) {
  return (point.homogeneous().transpose() * row_vector_matrix).head<3>().transpose();
}

/// Points that the lens cannot image get the reference's formula, which mirrors them.
Vec2 pixel_of(const Camera& camera, const Vec3& point_camera, bool is_replicator) {
  const std::optional<Vec2> exact = is_replicator ? std::nullopt : project(camera, point_camera);
  const Vec2 pixel = exact ? *exact : replicator_project(camera, point_camera);
  return {std::nearbyint(pixel.x()), std::nearbyint(pixel.y())};  // halves to even
}

std::optional<double> truncation_of(const std::array<Vec2, kKeypointCount>& pixels,
                                    const Camera& camera) {
  Vec2 lo = pixels[0];
  Vec2 hi = pixels[0];
  for (const Vec2& pixel : pixels) {
    lo = lo.cwiseMin(pixel);
    hi = hi.cwiseMax(pixel);
  }
  const double area = (hi - lo).prod();
  if (area == 0.0) return std::nullopt;
  const Vec2 size(camera.width, camera.height);
  const Vec2 inside = hi.cwiseMin(size).cwiseMax(0.0) - lo.cwiseMin(size).cwiseMax(0.0);
  return 1.0 - inside.prod() / area;
}

ObjectPose pose_of(const Frame& frame, const Instance& instance, const PoseFormat& format) {
  ObjectPose pose;
  pose.path = instance.node_path;
  // Transforms pass through 32-bit floats in the format; everything else is computed from them.
  pose.world_from_local = row_vector_matrix(instance.world_from_node).cast<float>().cast<double>();
  const Mat4 view = view_matrix(frame);
  pose.camera_from_local = format.is_replicator ? Mat4(view * pose.world_from_local)
                                                : Mat4(pose.world_from_local * view);
  const Vec3 scale = pose.world_from_local.topLeftCorner<3, 3>().rowwise().norm();
  pose.size = instance.bounds_node.size().cwiseProduct(scale);
  const auto& order = keypoint_order(format.layout);
  for (std::size_t i = 0; i < order.size(); ++i) {
    pose.world_points[i] =
        mapped(pose.world_from_local, keypoint_in_box(instance.bounds_node, order[i]));
    pose.camera_points[i] = mapped(view, pose.world_points[i]);
    pose.pixels[i] = pixel_of(frame.camera, pose.camera_points[i], format.is_replicator);
  }
  if (format.has_named_keypoints) {
    const Affine camera_from_world = frame.world_from_camera.inverse();
    for (const Keypoint& point : instance.keypoints) {
      const Vec3 world = instance.world_from_node * point.position;
      pose.named.push_back({point.name, camera_from_world * world, image_point(frame, world)});
    }
  }
  pose.truncation = truncation_of(pose.pixels, frame.camera);
  return pose;
}

}  // namespace

const KeypointOrder& keypoint_order(PoseLayout layout) {
  return layout == PoseLayout::Dope ? kDope : kCuboidKeypoints;
}

std::vector<ObjectPose> object_poses(const Frame& frame, const SemanticFilter& filter,
                                     const PoseFormat& format, double visibility_threshold) {
  std::vector<ObjectPose> poses;
  for (const FilteredInstance& filtered : filtered_instances(frame, filter)) {
    const Instance& instance = *filtered.instance;
    if (!instance.visibility) continue;
    const std::optional<double> occlusion = instance.visibility->occlusion();
    if (!occlusion || 1.0 - *occlusion <= visibility_threshold) continue;
    ObjectPose pose = pose_of(frame, instance, format);
    pose.label = filtered.labels.at("class");
    pose.visibility = 1.0 - *occlusion;
    poses.push_back(std::move(pose));
  }
  return poses;
}

Quat rotation_of(const Mat4& row_vector_matrix) {
  Affine map = Affine::Identity();
  map.linear() = row_vector_matrix.topLeftCorner<3, 3>().transpose();
  return Transform::from_affine(map).rotation;
}

}  // namespace diorama
