// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "framework/lint/lint_formats.h"
#include "framework/lint/replicator_files.h"

namespace diorama::lint {
namespace {

constexpr const char* kProject = "keypoints project onto their pixels";
constexpr const char* kPose = "pose agrees with the keypoints";

Mat4 matrix_of(const Json& rows) {
  Mat4 matrix;
  for (int i = 0; i < 16; ++i) {
    matrix(i / 4, i % 4) = rows.at(std::size_t(i / 4)).at(std::size_t(i % 4)).get<double>();
  }
  return matrix;
}

Vec3 vec3_of(const Json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

/// Which side of the box a keypoint's name means; zero for the centre.
Vec3 side_of(const std::string& name) {
  if (name == "Center") return Vec3::Zero();
  if (name.size() != 3) throw std::runtime_error("unknown keypoint '" + name + "'");
  return {name[0] == 'R' ? 1.0 : -1.0, name[1] == 'U' ? 1.0 : -1.0, name[2] == 'F' ? 1.0 : -1.0};
}

class PoseFile {
 public:
  PoseFile(Dataset& dataset, const std::string& file, const Json& json)
      : dataset_(dataset), file_(file), json_(json) {}

  void run() {
    const Json& data = json_.at("camera_data");
    const Json& intrinsics = data.at("intrinsics");
    view_ = matrix_of(data.at("camera_view_matrix"));
    focal_ = {intrinsics.at("fx").get<double>(), intrinsics.at("fy").get<double>()};
    centre_ = {intrinsics.at("cx").get<double>(), intrinsics.at("cy").get<double>()};
    for (const Json& name : json_.at("keypoint_order")) {
      sides_.push_back(side_of(name.get<std::string>()));
    }
    for (const Json& object : json_.at("objects")) check_object(object);
  }

 private:
  void check_object(const Json& object) {
    path_ = object.at("prim_path").get<std::string>();
    const double visibility = object.at("visibility").get<double>();
    dataset_.check(visibility >= 0.0 && visibility <= 1.0, "visible <= amodal", file_,
                   path_ + ": visibility " + std::to_string(visibility));
    if (object.contains("cuboid_keypoints_camera_frame")) {
      const auto points = points_of(object.at("cuboid_keypoints_camera_frame"));
      check_pixels(points, object.at("cuboid_keypoints_projected"));
      check_world(points, object.at("cuboid_keypoints_world_frame"));
      const Json& q = object.at("quat_wxyz_camera_frame");
      check_pose(points, vec3_of(object.at("location_camera_frame")),
                 Quat(q.at(0).get<double>(), q.at(1).get<double>(), q.at(2).get<double>(),
                      q.at(3).get<double>()),
                 vec3_of(object.at("size")));
      check_origin(object);
    } else if (object.contains("keypoints_3d")) {
      const auto points = points_of(object.at("keypoints_3d"));
      check_pixels(points, object.at("projected_cuboid"));
      const Json& q = object.at("quaternion_xyzw");
      check_pose(points, vec3_of(object.at("location")),
                 Quat(q.at(3).get<double>(), q.at(0).get<double>(), q.at(1).get<double>(),
                      q.at(2).get<double>()),
                 vec3_of(object.at("scale")));
    }
  }

  std::vector<Vec3> points_of(const Json& list) const {
    std::vector<Vec3> points;
    for (const Json& point : list) points.push_back(vec3_of(point));
    if (points.size() != sides_.size()) throw std::runtime_error(path_ + ": not nine keypoints");
    return points;
  }

  void check_pixels(const std::vector<Vec3>& points, const Json& pixels) {
    // With another lens than a pinhole the centre fits and the corners do not.
    if (!json_.at("camera_data").contains("camera_projection_matrix")) return;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (points[i].z() > -1e-6) continue;
      const Vec2 flat(points[i].x() / -points[i].z(), points[i].y() / points[i].z());
      const Vec2 expected = focal_.cwiseProduct(flat) + centre_;
      const Vec2 found(pixels.at(i).at(0).get<double>(), pixels.at(i).at(1).get<double>());
      dataset_.check((expected - found).cwiseAbs().maxCoeff() <= 0.51, kProject, file_,
                     path_ + ": keypoint " + std::to_string(i) + " is at " +
                         std::to_string(found.x()) + ", " + std::to_string(found.y()) +
                         ", its camera-space point projects to " + std::to_string(expected.x()) +
                         ", " + std::to_string(expected.y()));
    }
  }

  void check_world(const std::vector<Vec3>& points, const Json& world) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 mapped =
          (vec3_of(world.at(i)).homogeneous().transpose() * view_).head<3>().transpose();
      // The file's view matrix is rounded to five decimals.
      dataset_.check(
          (mapped - points[i]).norm() <= 1e-3 * (1.0 + points[i].norm()), kPose, file_,
          path_ + ": keypoint " + std::to_string(i) + " differs between world and camera frame");
    }
  }

  /// Turning the box's half diagonal by the quaternion leads from the centre to each corner.
  void check_pose(const std::vector<Vec3>& points, const Vec3& location, const Quat& rotation,
                  const Vec3& size) {
    dataset_.check(std::abs(rotation.norm() - 1.0) < 1e-4, kPose, file_,
                   path_ + ": the quaternion has length " + std::to_string(rotation.norm()));
    Vec3 centre = Vec3::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (sides_[i].isZero()) centre = points[i];
    }
    const double slack = 1e-3 + 0.01 * size.norm();
    double worst = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 corner = centre + rotation * (0.5 * sides_[i].cwiseProduct(size));
      worst = std::max(worst, (corner - points[i]).norm());
    }
    dataset_.check(worst <= slack, kPose, file_,
                   path_ + ": the camera-frame rotation puts a corner " + std::to_string(worst) +
                       " m beside its keypoint (swapped product or quaternion order?)");
    dataset_.check((location - centre).norm() <= 10.0 * size.norm() + slack, kPose, file_,
                   path_ + ": the camera-frame location is " +
                       std::to_string((location - centre).norm()) + " m from the box");
  }

  void check_origin(const Json& object) {
    const Vec3 mapped =
        (vec3_of(object.at("location_world_frame")).homogeneous().transpose() * view_)
            .head<3>()
            .transpose();
    const Vec3 found = vec3_of(object.at("location_camera_frame"));
    dataset_.check((mapped - found).norm() <= 1e-3 * (1.0 + mapped.norm()), kPose, file_,
                   path_ + ": the camera-frame location is " +
                       std::to_string((mapped - found).norm()) + " m from the world-frame one");
  }

  Dataset& dataset_;
  const std::string& file_;
  const Json& json_;
  std::string path_;
  Mat4 view_ = Mat4::Identity();
  Vec2 focal_ = Vec2::Ones();
  Vec2 centre_ = Vec2::Zero();
  std::vector<Vec3> sides_;
};

bool is_picture(const std::string& file) {
  return file.ends_with(".png") || file.ends_with(".jpg") || file.ends_with(".jpeg") ||
         file.ends_with(".exr");
}

}  // namespace

void lint_pose(Dataset& dataset) {
  std::set<std::string> stems;
  for (const std::string& file : dataset.files()) {
    const std::string stem = file.substr(0, file.rfind('.'));
    if (is_picture(file)) {
      dataset.picture(file);
      if (stem.ends_with("_overlay")) continue;
      dataset.check(dataset.has(stem + ".json"), "nothing is missing", stem + ".json",
                    "the poses of " + file + " are not there");
    } else if (file.ends_with(".json")) {
      const auto json = dataset.json(file);
      if (!json || !json->contains("keypoint_order")) continue;
      dataset.reading(file, [&] { PoseFile(dataset, file, *json).run(); });
      const bool has_picture = dataset.has(stem + ".png") || dataset.has(stem + ".jpg") ||
                               dataset.has(stem + ".jpeg") || dataset.has(stem + ".exr");
      dataset.check(has_picture, "nothing is missing", file, "its picture is not there");
    }
  }
}

void lint_visualization(Dataset& dataset) {
  std::map<std::string, std::set<std::string>> numbers;  // by name without number
  std::set<std::string> all;
  for (const std::string& file : dataset.files()) {
    if (!file.ends_with(".png")) continue;
    dataset.picture(file);
    const std::size_t cut = file.rfind('_');
    numbers[file.substr(0, cut)].insert(file.substr(cut));
    all.insert(file.substr(cut));
  }
  for (const auto& [name, found] : numbers) {
    for (const std::string& number : all) {
      dataset.check(found.contains(number), "nothing is missing", name + number,
                    "other pictures of this frame are there");
    }
  }
}

}  // namespace diorama::lint
