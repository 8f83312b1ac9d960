// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/camera.h"
#include "diorama/image.h"
#include "reader_support/stored_files.h"
#include "writer_pose/pose_data.h"

namespace diorama {

/// One object as a file has it. Matrices of row vectors, as in the files.
struct StoredPose {
  std::string label;
  std::string path;
  double visibility = 0.0;
  std::optional<double> truncation;
  std::vector<Vec2> pixels;      ///< Of the keypoints, in their order.
  Vec3 location = Vec3::Zero();  ///< Camera frame, as it stands there.
  Quat rotation = Quat::Identity();
  std::optional<Vec3> size;              ///< Not in DOPE's layout.
  std::vector<Vec3> camera_points;       ///< Nor are these.
  std::optional<Mat4> world_from_local;  ///< Full layout only, as the ones below.
  std::vector<Vec3> world_points;
  Vec3 world_location = Vec3::Zero();
  Quat world_rotation = Quat::Identity();
  Mat3 world_matrix = Mat3::Identity();
  Mat3 camera_matrix = Mat3::Identity();
  std::vector<ObjectPose::Named> named;  ///< Any layout.
};

/// Numbers beside the intrinsics that say the same, in millimetres.
struct StoredOptics {
  Vec2 aperture;
  Vec2 offset;
  double focal_length = 0.0;
  double metres_per_unit = 1.0;
};

/// A file.
struct StoredPoseFile {
  PoseLayout layout = PoseLayout::Full;
  Camera camera;      ///< Width 0 where the file does not say one.
  Camera projection;  ///< By the projection matrix: what the reference's own pixels follow.
  std::optional<Mat4> clip_from_camera;  ///< Of column vectors, where the size is known.
  std::optional<StoredOptics> optics;    ///< Full layout only.
  Mat4 view = Mat4::Identity();          ///< World to camera.
  std::vector<Vec3> sides;               ///< Of the keypoints: -1, 0 or 1 along each axis.
  std::vector<StoredPose> objects;
  Json clip = Json::object();  ///< What it says of its place in a clip, by the writer's keys.
};

/// The keys of a file that say its place in a clip, as far as they are there.
Json clip_entry(const Json& json);

/// The size of the picture, 0 where it is not known, fills in for files that do not say it. Throws
/// std::runtime_error or a JSON exception that says what is wrong.
StoredPoseFile parse_pose_file(const std::string& text, int width = 0, int height = 0);

/// True when the file is by the format's own rules: it names the order of its keypoints.
bool is_pose_file(const Json& json);

/// How far an object's corners, in metres, are from where rotation and location put them: with
/// the camera frame as it should be, and with the reference's swapped product. In DOPE's layout the
/// misses are angles. Nothing where the object is too symmetric or thin to tell.
struct PoseMiss {
  double right = 0.0;
  double swapped = 0.0;
};
std::optional<PoseMiss> pose_miss(const StoredPoseFile& file, const StoredPose& object);

/// The rotation from the box to the camera that a file with the swapped product means.
Mat3 unswapped(const StoredPoseFile& file, const Mat3& camera_from_local);

}  // namespace diorama
