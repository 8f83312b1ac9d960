// SPDX-License-Identifier: Apache-2.0
#include <Eigen/SVD>
#include <cmath>

#include "framework/lint/lint_formats.h"
#include "framework/lint/object_checks.h"

namespace diorama::lint {
namespace {

constexpr const char* kProject = "keypoints project onto their pixels";
constexpr const char* kPose = "pose agrees with the keypoints";

/// Which side of the box a keypoint's name means; zero for the centre.
Vec3 side_of(const std::string& name) {
  if (name == "Center") return Vec3::Zero();
  if (name.size() != 3) throw std::runtime_error("unknown keypoint '" + name + "'");
  return {name[0] == 'R' ? 1.0 : -1.0, name[1] == 'U' ? 1.0 : -1.0, name[2] == 'F' ? 1.0 : -1.0};
}

class PoseFile {
 public:
  /// `origins` holds what earlier files say of where an object's origin lies in its box.
  PoseFile(Dataset& dataset, const std::string& file, const Json& json,
           std::map<std::string, Vec3>& origins)
      : dataset_(dataset), file_(file), json_(json), origins_(origins) {}

  void run() {
    const Json& data = json_.at("camera_data");
    const Json& intrinsics = data.at("intrinsics");
    view_ = matrix4_of(data.at("camera_view_matrix"));
    const Mat3 camera =
        intrinsics_matrix(intrinsics.at("fx").get<double>(), intrinsics.at("fy").get<double>(),
                          intrinsics.at("cx").get<double>(), intrinsics.at("cy").get<double>());
    // The picture's size is not in every format; bounds on pixels need none.
    lens_ = lens_of(data, 4096, 4096, camera);
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
      check_pose(points, vec3_of(object.at("location")), quaternion_xyzw(q),
                 vec3_of(object.at("scale")));
    } else {
      check_box_fits(object.at("projected_cuboid"), vec3_of(object.at("location")),
                     quaternion_xyzw(object.at("quaternion_xyzw")));
    }
  }

  std::vector<Vec3> points_of(const Json& list) const {
    std::vector<Vec3> points;
    for (const Json& point : list) points.push_back(vec3_of(point));
    if (points.size() != sides_.size()) throw std::runtime_error(path_ + ": not nine keypoints");
    return points;
  }

  static Quat quaternion_xyzw(const Json& q) {
    return Quat(q.at(3).get<double>(), q.at(0).get<double>(), q.at(1).get<double>(),
                q.at(2).get<double>());
  }

  void check_pixels(const std::vector<Vec3>& points, const Json& pixels) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto expected = lens_.pixel(flipped_axes() * points[i]);
      if (!expected) continue;
      const Vec2 found(pixels.at(i).at(0).get<double>(), pixels.at(i).at(1).get<double>());
      dataset_.check((*expected - found).cwiseAbs().maxCoeff() <= 0.51, kProject, file_,
                     path_ + ": keypoint " + std::to_string(i) + " is at " +
                         std::to_string(found.x()) + ", " + std::to_string(found.y()) +
                         ", its camera-space point projects to " + std::to_string(expected->x()) +
                         ", " + std::to_string(expected->y()));
    }
  }

  /// DOPE's files say neither size nor keypoints in space. Pixels and rotation must leave room for
  /// some box: its middle c and half size h solve, for every keypoint, d x (c + R (side h)) = 0
  /// with d the direction of the pixel. Both are found but for a common factor.
  void check_box_fits(const Json& pixels, const Vec3& location, const Quat& rotation) {
    check_length(rotation);
    const Mat3 turn = flipped_axes().linear() * rotation.toRotationMatrix();
    Eigen::MatrixXd equations(3 * Eigen::Index(sides_.size()), 6);
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const Vec2 pixel(pixels.at(i).at(0).get<double>(), pixels.at(i).at(1).get<double>());
      const auto direction = lens_.direction(pixel);
      if (!direction) return;
      const Vec3 d = direction->normalized();
      Mat3 cross;
      cross << 0.0, -d.z(), d.y(), d.z(), 0.0, -d.x(), -d.y(), d.x(), 0.0;
      equations.block<3, 3>(3 * Eigen::Index(i), 0) = cross;
      equations.block<3, 3>(3 * Eigen::Index(i), 3) = cross * turn * sides_[i].asDiagonal();
    }
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(equations, Eigen::ComputeThinV);
    Eigen::VectorXd box = svd.matrixV().col(5);
    box /= box.head<3>().norm();
    if (box.tail<3>().sum() < 0.0) box = -box;
    // A pixel is known to a half.
    const double slack = 1.5 / lens_.focal.minCoeff();
    const double miss = (equations * box).cwiseAbs().maxCoeff();
    dataset_.check(miss <= slack && (box.tail<3>().array() > -slack).all(), kPose, file_,
                   path_ +
                       ": no box with this rotation has these corners; the best misses them by " +
                       std::to_string(miss) + " rad (quaternion order?)");
    const Vec3 seen = (flipped_axes() * location).normalized();
    dataset_.check((seen - box.head<3>()).norm() <= 3.0 * box.tail<3>().norm() + slack, kPose,
                   file_, path_ + ": its location is not where its corners are");
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
    check_length(rotation);
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
    check_origin_in_box(rotation.inverse() * (location - centre), size);
  }

  /// Where the origin lies in the box is the same in all files. Comparing needs a box with volume.
  void check_origin_in_box(const Vec3& origin, const Vec3& size) {
    if (!(size.minCoeff() > 1e-6)) return;
    const Vec3 share = origin.cwiseQuotient(size);
    const auto [known, is_new] = origins_.emplace(path_, share);
    const Vec3 slack = Vec3::Constant(1e-3 + 0.01 * size.norm()).cwiseQuotient(size);
    dataset_.check(((share - known->second).cwiseAbs().array() <= slack.array()).all(), kPose,
                   file_,
                   path_ +
                       ": its camera-frame location lies elsewhere in its box than in other "
                       "files");
  }

  void check_length(const Quat& rotation) {
    dataset_.check(std::abs(rotation.norm() - 1.0) < 1e-4, kPose, file_,
                   path_ + ": the quaternion has length " + std::to_string(rotation.norm()));
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
  std::map<std::string, Vec3>& origins_;
  std::string path_;
  Mat4 view_ = Mat4::Identity();
  Lens lens_;
  std::vector<Vec3> sides_;
};

bool is_picture(const std::string& file) {
  return file.ends_with(".png") || file.ends_with(".jpg") || file.ends_with(".jpeg") ||
         file.ends_with(".exr");
}

}  // namespace

void lint_pose(Dataset& dataset) {
  std::vector<std::string> overlays;
  std::map<std::string, Vec3> origins;
  for (const std::string& file : dataset.files()) {
    const std::string stem = file.substr(0, file.rfind('.'));
    if (is_picture(file)) {
      dataset.picture(file);
      if (stem.ends_with("_overlay")) continue;
      dataset.check(dataset.has(stem + ".json"), "nothing is missing", stem + ".json",
                    "the poses of " + file + " are not there");
      overlays.push_back(stem + "_overlay" +
                         (file.ends_with(".exr") ? ".png" : file.substr(stem.size())));
    } else if (file.ends_with(".json")) {
      const auto json = dataset.json(file);
      if (!json || !json->contains("keypoint_order")) continue;
      dataset.reading(file, [&] { PoseFile(dataset, file, *json, origins).run(); });
      const bool has_picture = dataset.has(stem + ".png") || dataset.has(stem + ".jpg") ||
                               dataset.has(stem + ".jpeg") || dataset.has(stem + ".exr");
      dataset.check(has_picture, "nothing is missing", file, "its picture is not there");
    }
  }
  check_all_or_none(dataset, overlays);
}

void lint_visualization(Dataset& dataset) {
  std::set<std::string> folders, kinds, numbers;
  for (const std::string& file : dataset.files()) {
    if (!file.ends_with(".png")) continue;
    dataset.picture(file);
    const std::size_t slash = file.rfind('/') + 1;  // 0 without a folder
    const std::size_t cut = file.rfind('_');
    if (cut == std::string::npos || cut < slash) continue;
    folders.insert(file.substr(0, slash));
    kinds.insert(file.substr(slash, cut - slash));
    numbers.insert(file.substr(cut));
  }
  if (folders.size() * kinds.size() * numbers.size() > 1000 + 100 * dataset.files().size()) {
    throw std::runtime_error("its files are not those of one dataset");
  }
  for (const std::string& folder : folders) {
    for (const std::string& kind : kinds) {
      for (const std::string& number : numbers) {
        const std::string file = folder + kind + number;
        dataset.check(dataset.has(file), "nothing is missing", file,
                      "other pictures of this frame are there");
      }
    }
  }
}

}  // namespace diorama::lint
