// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diorama/frame.h"
#include "writer_support/cuboid.h"
#include "writer_support/label_sets.h"

namespace diorama {

enum class PoseLayout : std::uint8_t { Full, Dope, CenterPose };

struct PoseFormat {
  PoseLayout layout = PoseLayout::Full;
  bool is_replicator = false;  ///< Repeat the reference's known errors.
  bool has_named_keypoints = false;
};

const KeypointOrder& keypoint_order(PoseLayout layout);

/// What is known of one object. Matrices are row-vector matrices, metres; the camera frame looks
/// along -z, y up.
struct ObjectPose {
  std::string label;
  std::string path;
  double visibility = 0.0;
  Mat4 world_from_local;   ///< Local to world.
  Mat4 camera_from_local;  ///< Local to camera (with is_replicator: the reference's swapped
                           ///< product).
  Vec3 size;               ///< Of the local box, times the scale.
  std::array<Vec3, kKeypointCount> world_points;
  std::array<Vec3, kKeypointCount> camera_points;
  std::array<Vec2, kKeypointCount> pixels;  ///< Whole numbers.
  /// Named ones of the asset: place in the camera frame, and in the image.
  struct Named {
    std::string name;
    Vec3 camera_point;
    ImagePoint image;
  };
  std::vector<Named> named;
  /// Share of the pixels' box that lies outside the image; nothing when that box has no area.
  std::optional<double> truncation;
};

/// The objects in the image with a class label and more visibility than the threshold, in the order
/// of Frame::instances.
std::vector<ObjectPose> object_poses(const Frame& frame, const SemanticFilter& filter,
                                     const PoseFormat& format, double visibility_threshold);

/// Rotation of a row-vector matrix, scale and shear removed (polar decomposition).
Quat rotation_of(const Mat4& row_vector_matrix);

}  // namespace diorama
