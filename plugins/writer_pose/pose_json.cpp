// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/pose_json.h"

#include "writer_support/camera_matrices.h"
#include "writer_support/lens_json.h"

namespace diorama {
namespace {

double single(double value) { return double(float(value)); }

Json rounded_rows(const Mat4& matrix) {
  return nested_list(matrix.unaryExpr([](double value) { return python_round(value, 5); }));
}

Json intrinsics_json(const Camera& camera, bool is_replicator) {
  Json json = Json::object();
  if (is_replicator) {
    // The reference takes square pixels and adds an offset in millimetres to pixels.
    const double per_pixel = single(aperture_mm(camera).x()) / camera.width;
    const Vec2 offset = aperture_offset_mm(camera);
    json["fx"] = single(focal_length_mm(camera)) / per_pixel;
    json["fy"] = json["fx"];
    json["cx"] = 0.5 * camera.width + single(offset.x());
    json["cy"] = 0.5 * camera.height + single(offset.y());
    return json;
  }
  json["fx"] = camera.fx;
  json["fy"] = camera.fy;
  json["cx"] = camera.cx;
  json["cy"] = camera.cy;
  return json;
}

Json camera_json(const Frame& frame, const PoseFormat& format) {
  const Camera& camera = frame.camera;
  Json json = Json::object();
  if (format.layout == PoseLayout::Full) {
    const Vec2 aperture = aperture_mm(camera);
    const Vec2 offset = aperture_offset_mm(camera);
    json["aperture"] = {single(aperture.x()), single(aperture.y())};
    json["aperture_offset"] = {single(offset.x()), single(offset.y())};
    json["focal_length"] = single(focal_length_mm(camera));
    json["resolution"] = {camera.width, camera.height};
    json["meters_per_scene_unit"] = 1.0;
  }
  json["intrinsics"] = intrinsics_json(camera, format.is_replicator);
  json["camera_view_matrix"] = rounded_rows(view_matrix(frame));
  json["camera_projection_matrix"] = rounded_rows(projection_matrix(camera));
  if (camera.lens != LensModel::Pinhole && !format.is_replicator) {
    json["lens"] = lens_json(camera);
  }
  if (format.layout == PoseLayout::CenterPose) {
    json["width"] = camera.width;
    json["height"] = camera.height;
  }
  return json;
}

Json points_json(const std::array<Vec3, kKeypointCount>& points) {
  Json json = Json::array();
  for (const Vec3& point : points) json.push_back(flat_list(point.transpose()));
  return json;
}

Json pixels_json(const std::array<Vec2, kKeypointCount>& pixels) {
  Json json = Json::array();
  for (const Vec2& pixel : pixels) {
    json.push_back({std::int64_t(pixel.x()), std::int64_t(pixel.y())});
  }
  return json;
}

Json translation_json(const Mat4& matrix) { return flat_list(matrix.row(3).head<3>()); }

Json quaternion_wxyz(const Mat4& matrix) {
  const Quat q = rotation_of(matrix);
  return {q.w(), q.x(), q.y(), q.z()};
}

Json quaternion_xyzw(const Mat4& matrix) {
  const Quat q = rotation_of(matrix);
  return {q.x(), q.y(), q.z(), q.w()};
}

void add_full(Json& json, const ObjectPose& object) {
  json["local_to_world_transform"] = nested_list(object.world_from_local);
  json["location_world_frame"] = translation_json(object.world_from_local);
  json["rotation_matrix_world_frame"] = nested_list(object.world_from_local.topLeftCorner<3, 3>());
  json["quat_wxyz_world_frame"] = quaternion_wxyz(object.world_from_local);
  json["location_camera_frame"] = translation_json(object.camera_from_local);
  json["rotation_matrix_camera_frame"] =
      nested_list(object.camera_from_local.topLeftCorner<3, 3>());
  json["quat_wxyz_camera_frame"] = quaternion_wxyz(object.camera_from_local);
  json["size"] = flat_list(object.size.transpose());
  json["cuboid_keypoints_world_frame"] = points_json(object.world_points);
  json["cuboid_keypoints_camera_frame"] = points_json(object.camera_points);
  json["cuboid_keypoints_projected"] = pixels_json(object.pixels);
}

void add_trained_formats(Json& json, const ObjectPose& object, PoseLayout layout) {
  json["location"] = translation_json(object.camera_from_local);
  json["quaternion_xyzw"] = quaternion_xyzw(object.camera_from_local);
  if (layout == PoseLayout::CenterPose) {
    json["scale"] = flat_list(object.size.transpose());
    json["keypoints_3d"] = points_json(object.camera_points);
  }
  json["projected_cuboid"] = pixels_json(object.pixels);
}

Json object_json(const ObjectPose& object, PoseLayout layout) {
  Json json = Json::object();
  json[layout == PoseLayout::Dope ? "class" : "label"] = object.label;
  json["prim_path"] = object.path;
  json["visibility"] = python_round(object.visibility, 3);
  if (layout == PoseLayout::Full) {
    add_full(json, object);
  } else {
    add_trained_formats(json, object, layout);
  }
  for (const ObjectPose::Named& point : object.named) {
    json["named_keypoints"].push_back(
        {{"name", point.name},
         {"location_camera_frame", flat_list(point.camera_point.transpose())},
         {"projected",
          {python_round(point.image.pixel.x(), 3), python_round(point.image.pixel.y(), 3)}},
         {"visibility", int(point.image.state)}});
  }
  // The reference prints the integer 1 for a box without area.
  json["truncation_ratio"] = object.truncation ? Json(*object.truncation) : Json(1);
  return json;
}

}  // namespace

Json pose_json(const Frame& frame, const std::vector<ObjectPose>& objects,
               const PoseFormat& format) {
  Json json = Json::object();
  json["camera_data"] = camera_json(frame, format);
  json["keypoint_order"] = Json::array();
  for (const CuboidPoint& keypoint : keypoint_order(format.layout)) {
    json["keypoint_order"].push_back(keypoint.name);
  }
  json["objects"] = Json::array();
  for (const ObjectPose& object : objects) {
    json["objects"].push_back(object_json(object, format.layout));
  }
  return json;
}

}  // namespace diorama
