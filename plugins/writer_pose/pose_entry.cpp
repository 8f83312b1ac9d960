// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/pose_entry.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "reader_support/camera_json.h"

namespace diorama {
namespace {

constexpr std::size_t kMostObjects = 100'000;

double finite(double value) {
  if (!std::isfinite(value)) throw std::runtime_error("has a number that is not finite");
  return value;
}

template <int kRows>
Eigen::Matrix<double, kRows, kRows> rows_of(const Json& rows) {
  const auto is_full = [](const Json& list) { return list.size() == std::size_t(kRows); };
  if (!is_full(rows) || !std::ranges::all_of(rows, is_full)) {
    throw std::runtime_error("a matrix has not " + std::to_string(kRows) + " rows of as many");
  }
  Eigen::Matrix<double, kRows, kRows> matrix;
  for (int i = 0; i < kRows * kRows; ++i) {
    const Json& value = rows.at(std::size_t(i / kRows)).at(std::size_t(i % kRows));
    matrix(i / kRows, i % kRows) = finite(value.get<double>());
  }
  return matrix;
}

Quat quaternion(const Json& q, bool w_first) {
  const auto at = [&](std::size_t i) { return finite(q.at(i).get<double>()); };
  return w_first ? Quat(at(0), at(1), at(2), at(3)) : Quat(at(3), at(0), at(1), at(2));
}

/// Which side of the box a keypoint's name means; zero for the centre.
Vec3 side_of(const std::string& name) {
  if (name == "Center") return Vec3::Zero();
  if (name.size() != 3) throw std::runtime_error("unknown keypoint '" + name + "'");
  return {name[0] == 'R' ? 1.0 : -1.0, name[1] == 'U' ? 1.0 : -1.0, name[2] == 'F' ? 1.0 : -1.0};
}

std::vector<Vec3> points_of(const Json& list, std::size_t count) {
  std::vector<Vec3> points;
  for (const Json& point : list) points.push_back(vector_of_json(point));
  if (points.size() != count) {
    throw std::runtime_error("has " + std::to_string(points.size()) + " keypoints of " +
                             std::to_string(count));
  }
  return points;
}

std::vector<Vec2> pixels_of(const Json& list, std::size_t count) {
  std::vector<Vec2> pixels;
  for (const Json& pixel : list) {
    pixels.emplace_back(finite(pixel.at(0).get<double>()), finite(pixel.at(1).get<double>()));
  }
  if (pixels.size() != count) {
    throw std::runtime_error("has " + std::to_string(pixels.size()) + " keypoints of " +
                             std::to_string(count));
  }
  return pixels;
}

StoredOptics optics_of(const Json& data) {
  const auto pair = [&](const char* name) {
    const Json& list = data.at(name);
    return Vec2(finite(list.at(0).get<double>()), finite(list.at(1).get<double>()));
  };
  return {pair("aperture"), pair("aperture_offset"), finite(data.at("focal_length").get<double>()),
          finite(data.at("meters_per_scene_unit").get<double>())};
}

std::vector<ObjectPose::Named> named_of(const Json& json) {
  std::vector<ObjectPose::Named> points;
  if (!json.contains("named_keypoints")) return points;
  for (const Json& entry : json.at("named_keypoints")) {
    ObjectPose::Named point;
    point.name = entry.at("name").get<std::string>();
    point.camera_point = vector_of_json(entry.at("location_camera_frame"));
    const Json& pixel = entry.at("projected");
    point.image.pixel = {finite(pixel.at(0).get<double>()), finite(pixel.at(1).get<double>())};
    const int state = whole_number<int>(entry.at("visibility"));
    if (state < 0 || state > 2)
      throw std::runtime_error("a keypoint's visibility is not 0, 1 or 2");
    point.image.state = ImagePoint::State(state);
    points.push_back(std::move(point));
  }
  return points;
}

StoredPose pose_of(const Json& json, StoredPoseFile& file) {
  StoredPose pose;
  const std::size_t count = file.sides.size();
  pose.label = json.at(json.contains("label") ? "label" : "class").get<std::string>();
  pose.path = json.at("prim_path").get<std::string>();
  pose.visibility = finite(json.at("visibility").get<double>());
  pose.named = named_of(json);
  if (json.contains("truncation_ratio")) {
    pose.truncation = finite(json.at("truncation_ratio").get<double>());
  }
  if (json.contains("cuboid_keypoints_camera_frame")) {
    file.layout = PoseLayout::Full;
    pose.pixels = pixels_of(json.at("cuboid_keypoints_projected"), count);
    pose.camera_points = points_of(json.at("cuboid_keypoints_camera_frame"), count);
    pose.world_points = points_of(json.at("cuboid_keypoints_world_frame"), count);
    pose.location = vector_of_json(json.at("location_camera_frame"));
    pose.rotation = quaternion(json.at("quat_wxyz_camera_frame"), true);
    pose.size = vector_of_json(json.at("size"));
    pose.world_from_local = rows_of<4>(json.at("local_to_world_transform"));
    pose.world_location = vector_of_json(json.at("location_world_frame"));
    pose.world_rotation = quaternion(json.at("quat_wxyz_world_frame"), true);
    pose.world_matrix = rows_of<3>(json.at("rotation_matrix_world_frame"));
    pose.camera_matrix = rows_of<3>(json.at("rotation_matrix_camera_frame"));
    return pose;
  }
  pose.pixels = pixels_of(json.at("projected_cuboid"), count);
  pose.location = vector_of_json(json.at("location"));
  pose.rotation = quaternion(json.at("quaternion_xyzw"), false);
  file.layout = json.contains("keypoints_3d") ? PoseLayout::CenterPose : PoseLayout::Dope;
  if (file.layout == PoseLayout::CenterPose) {
    pose.camera_points = points_of(json.at("keypoints_3d"), count);
    pose.size = vector_of_json(json.at("scale"));
  }
  return pose;
}

/// The largest distance between a corner and where this rotation about the box's middle puts it.
double corner_miss(const StoredPoseFile& file, const StoredPose& object, const Mat3& rotation) {
  Vec3 centre = Vec3::Zero();
  for (std::size_t i = 0; i < file.sides.size(); ++i) {
    if (file.sides[i].isZero()) centre = object.camera_points[i];
  }
  double worst = 0.0;
  for (std::size_t i = 0; i < file.sides.size(); ++i) {
    const Vec3 corner = centre + rotation * (0.5 * file.sides[i].cwiseProduct(*object.size));
    worst = std::max(worst, (corner - object.camera_points[i]).norm());
  }
  return worst;
}

/// DOPE's files say neither size nor keypoints in space. Pixels and rotation must leave room for
/// some box: its middle c and half size h solve, for every keypoint, d x (c + R (side h)) = 0 with
/// d the direction of the pixel. Both are found but for a common factor.
std::optional<double> ray_miss(const StoredPoseFile& file, const StoredPose& object,
                               const Mat3& rotation) {
  Eigen::MatrixXd equations(3 * Eigen::Index(file.sides.size()), 6);
  for (std::size_t i = 0; i < file.sides.size(); ++i) {
    const auto direction = ray_direction(file.camera, object.pixels[i]);
    if (!direction) return std::nullopt;
    const Vec3 d = direction->normalized();
    Mat3 cross;
    cross << 0.0, -d.z(), d.y(), d.z(), 0.0, -d.x(), -d.y(), d.x(), 0.0;
    equations.block<3, 3>(3 * Eigen::Index(i), 0) = cross;
    equations.block<3, 3>(3 * Eigen::Index(i), 3) = cross * rotation * file.sides[i].asDiagonal();
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(equations, Eigen::ComputeThinV);
  Eigen::VectorXd box = svd.matrixV().col(5);
  const double distance = box.head<3>().norm();
  if (!(distance > 1e-9)) return kPi;
  box /= distance;
  if (box.tail<3>().sum() < 0.0) box = -box;
  const double slack = 1.5 / std::min(file.camera.fx, file.camera.fy);
  if (!(box.tail<3>().array() > -slack).all()) return kPi;
  // The location is where the corners are.
  const Vec3 seen = object.location.normalized();
  const double aside = (seen - box.head<3>()).norm() - 3.0 * box.tail<3>().norm();
  return std::max((equations * box).cwiseAbs().maxCoeff(), aside);
}

}  // namespace

bool is_pose_file(const Json& json) {
  return json.is_object() && json.contains("camera_data") && json.contains("keypoint_order") &&
         json.contains("objects");
}

Json clip_entry(const Json& json) {
  Json entry = Json::object();
  for (const char* key : {"clip", "frame_index", "time_s"}) {
    if (json.contains(key)) entry[key] = json.at(key);
  }
  return entry;
}

StoredPoseFile parse_pose_file(const std::string& text, int width, int height) {
  const Json json = parse_stored_json(text);
  if (!is_pose_file(json)) {
    throw std::runtime_error("has no camera_data, keypoint_order and objects");
  }
  StoredPoseFile file;
  const Json& data = json.at("camera_data");
  const Json& intrinsics = data.at("intrinsics");
  Camera& camera = file.camera;
  camera.width = width;
  camera.height = height;
  camera.fx = intrinsics.at("fx").get<double>();
  camera.fy = intrinsics.at("fy").get<double>();
  camera.cx = intrinsics.at("cx").get<double>();
  camera.cy = intrinsics.at("cy").get<double>();
  if (data.contains("resolution")) {
    camera.width = whole_number<int>(data.at("resolution").at(0));
    camera.height = whole_number<int>(data.at("resolution").at(1));
  } else if (data.contains("width")) {
    camera.width = whole_number<int>(data.at("width"));
    camera.height = whole_number<int>(data.at("height"));
  }
  constexpr int kMostExtent = 1 << 20;
  if (camera.width < 0 || camera.height < 0 || camera.width > kMostExtent ||
      camera.height > kMostExtent) {
    throw std::runtime_error("its size is none");
  }
  read_lens_entry(data, camera);
  // Fisheye lenses have no use for it.
  if (camera.lens != LensModel::FisheyePolynomial) require_usable(camera);
  file.projection = camera;
  if (data.contains("camera_projection_matrix") && camera.width > 0) {
    const Mat4 p = rows_of<4>(data.at("camera_projection_matrix"));
    file.clip_from_camera = p.transpose();
    file.projection.fx = 0.5 * p(0, 0) * camera.width;
    file.projection.fy = 0.5 * p(1, 1) * camera.height;
    file.projection.cx = 0.5 * (1.0 - p(2, 0)) * camera.width;
    file.projection.cy = 0.5 * (1.0 + p(2, 1)) * camera.height;
  }
  file.view = rows_of<4>(data.at("camera_view_matrix"));
  if (data.contains("aperture")) file.optics = optics_of(data);
  for (const Json& name : json.at("keypoint_order")) {
    if (file.sides.size() >= kKeypointCount) throw std::runtime_error("names too many keypoints");
    file.sides.push_back(side_of(name.get<std::string>()));
  }
  if (file.sides.size() != kKeypointCount) throw std::runtime_error("names too few keypoints");
  const Json& objects = json.at("objects");
  if (objects.size() > kMostObjects) throw std::runtime_error("has too many objects");
  for (const Json& object : objects) file.objects.push_back(pose_of(object, file));
  file.clip = clip_entry(json);
  return file;
}

Mat3 unswapped(const StoredPoseFile& file, const Mat3& camera_from_local) {
  // In row vectors the file has V W instead of W V.
  const Mat3 view = file.view.topLeftCorner<3, 3>();
  return (view.inverse() * camera_from_local.transpose() * view).transpose();
}

std::optional<PoseMiss> pose_miss(const StoredPoseFile& file, const StoredPose& object) {
  const Mat3 rotation = object.rotation.toRotationMatrix();
  const Mat3 other = unswapped(file, rotation);
  if (!other.allFinite()) return std::nullopt;
  if (!object.camera_points.empty() && object.size) {
    return PoseMiss{corner_miss(file, object, rotation), corner_miss(file, object, other)};
  }
  const auto right = ray_miss(file, object, rotation);
  // Where the product puts the origin does not follow from what the file says.
  StoredPose turned = object;
  const auto place = std::ranges::find_if(file.sides, [](const Vec3& s) { return s.isZero(); });
  if (place != file.sides.end()) {
    const auto ray =
        ray_direction(file.camera, object.pixels[std::size_t(place - file.sides.begin())]);
    if (ray) turned.location = *ray;
  }
  const auto swapped = ray_miss(file, turned, other);
  if (!right || !swapped) return std::nullopt;
  return PoseMiss{*right, *swapped};
}

}  // namespace diorama
