// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_writer.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "writer_bop/bop_model.h"
#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"
#include "writer_support/replicator.h"

namespace diorama {
namespace {

constexpr double kMillimetres = 1000.0;

/// BOP's camera axes from ours: y and z change sign.
Affine bop_from_camera() {
  Affine map = Affine::Identity();
  map.linear() = Vec3(1.0, -1.0, -1.0).asDiagonal();
  return map;
}

Json intrinsics_json(const Camera& camera) {
  return {camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0};
}

Json camera_json(const Frame& frame, double depth_scale) {
  const Affine camera_from_world = bop_from_camera() * frame.world_from_camera.inverse();
  Json json{{"cam_K", intrinsics_json(frame.camera)},
            {"depth_scale", depth_scale},
            {"cam_R_w2c", flat_list(camera_from_world.linear())},
            {"cam_t_w2c", flat_list((kMillimetres * camera_from_world.translation()).transpose())}};
  if (frame.camera.lens != LensModel::Pinhole) json["lens"] = lens_json(frame.camera);
  return json;
}

Json pose_json(const Frame& frame, const TrainingObject& object, int object_id) {
  const Affine camera_from_model =
      bop_from_camera() * frame.world_from_camera.inverse() * object.instance->world_from_node;
  const Transform parts = Transform::from_affine(camera_from_model);
  const Aabb& bounds = object.instance->bounds_node;
  return {{"cam_R_m2c", flat_list(parts.rotation.toRotationMatrix())},
          {"cam_t_m2c", flat_list((kMillimetres * parts.translation).transpose())},
          {"obj_id", object_id},
          {"scale", flat_list(parts.scale.transpose())},
          {"bounds_min", flat_list((kMillimetres * bounds.min).transpose())},
          {"bounds_max", flat_list((kMillimetres * bounds.max).transpose())},
          {"node", object.instance->node_path}};
}

Json box_json(const PixelBox& box) { return {box.x_min, box.y_min, box.width(), box.height()}; }

Json info_json(const TrainingObject& object, std::int64_t valid_pixels) {
  const Visibility& visibility = *object.instance->visibility;
  return {{"bbox_obj", box_json(*visibility.amodal_box)},
          {"bbox_visib", box_json(*object.instance->tight_box)},
          {"px_count_all", visibility.amodal_pixels},
          {"px_count_valid", valid_pixels},
          {"px_count_visib", visibility.visible_pixels},
          {"visib_fract", 1.0 - visibility.occlusion().value_or(0.0)}};
}

Json model_json(const Aabb& box, double diameter) {
  const Vec3 lo = box.min;
  const Vec3 size = box.size();
  return {{"diameter", diameter}, {"min_x", lo.x()},    {"min_y", lo.y()},   {"min_z", lo.z()},
          {"size_x", size.x()},   {"size_y", size.y()}, {"size_z", size.z()}};
}

Vec3 vec3_of(const Json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

Image<std::uint32_t> depth_picture(const Image<float>& depth, double scale) {
  Image<std::uint32_t> picture(depth.width(), depth.height(), 0);
  for (std::size_t i = 0; i < depth.pixels().size(); ++i) {
    const double value = std::round(kMillimetres / scale * double(depth.pixels()[i]));
    if (value <= 65535.0) picture.pixels()[i] = std::uint32_t(value);
  }
  return picture;
}

std::string model_file(int id) { return "models/obj_" + padded(id, 6) + ".ply"; }

std::string scene_name(std::size_t camera) { return padded(int(camera), 6); }

}  // namespace

void BopWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  v.param("depth_scale", depth_scale,
          {"Millimetres per unit of the depth pictures; 0.1 reaches 6.5 m.", "mm", 0.001, 1000.0});
}

BopWriter::BopWriter(Params params, Host& host)
    : params_(std::move(params)), host_(host), training_(params_.training) {}

NameSet BopWriter::needs() const {
  return {std::string(kColor.name),
          std::string(kInstanceId.name),
          std::string(kDistanceToImagePlane.name),
          "instances",
          "visibility",
          "amodal_mask"};
}

const char* BopWriter::split_folder(int capture) const {
  return std::string_view(training_.split(capture)) == "val" ? "test" : "train_pbr";
}

void BopWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  add_objects(dataset, files);
  Json names = Json::object();
  Json objects = Json::array();
  for (const Object& object : objects_) {
    const int id = int(objects.size()) + 1;
    const std::string& name = training_.classes()[std::size_t(object.class_index)];
    names[std::to_string(id)] = name;
    objects.push_back({{"obj_id", id}, {"class", name}});
    if (!object.asset.empty()) objects.back()["model"] = object.asset;
  }
  files.add_text("objects.json", python_json(names, 2) + "\n");
  training_.add_dataset_page("BOP",
                             {{"units", "millimetres"},
                              {"camera_axes", "x right, y down, z forward"},
                              {"pose", "point_camera = R (scale * point_model) + t"},
                              {"depth", "along the viewing axis, 16 bit x depth_scale, 0: nothing"},
                              {"scene", "one camera; image ids are captures"},
                              {"objects", std::move(objects)}},
                             dataset, files);
}

void BopWriter::add_objects(const DatasetInfo& dataset, DatasetFiles& files) {
  objects_.clear();
  for (int index = 0; index < int(training_.classes().size()); ++index) {
    const std::size_t before = objects_.size();
    for (const DatasetAsset& asset : dataset.assets) {
      if (std::ranges::count(training_.classes_of(asset.labels), index) == 0) continue;
      Scene scene;
      const BopModel model = bop_model(scene, host_.load_asset(asset.asset, scene, scene.root()));
      if (model.is_empty()) continue;
      const Aabb box = model.bounds();
      objects_.push_back({index,
                          asset.asset,
                          {box.min / kMillimetres, box.max / kMillimetres},
                          model_json(box, model.diameter())});
      files.add(model_file(int(objects_.size())), model.ply());
    }
    if (objects_.size() == before) objects_.push_back({index, {}, {}, {}});
  }
}

/// Of several models of a class, the one as large as the object.
int BopWriter::object_id(const TrainingObject& object) const {
  const Aabb& wanted = object.instance->bounds_node;
  int best = 0;
  double best_distance = kInfinity;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (objects_[i].class_index != object.class_index) continue;
    const Aabb& box = objects_[i].bounds;
    const double distance = (box.min - wanted.min).norm() + (box.max - wanted.max).norm();
    if (best > 0 && !(distance < best_distance)) continue;
    best = int(i) + 1;
    best_distance = distance;
  }
  return best;
}

void BopWriter::add_masks(const Frame& frame, const Instance& instance, const std::string& scene,
                          const std::string& name, CaptureFiles& files) const {
  const auto& ids = frame.get(kInstanceId);
  std::vector<std::uint8_t> whole(ids.pixels().size(), 0);
  std::vector<std::uint8_t> visible(ids.pixels().size(), 0);
  for (int y = 0; y < ids.height(); ++y) {
    for (int x = 0; x < ids.width(); ++x) {
      const std::size_t i = std::size_t(y) * std::size_t(ids.width()) + std::size_t(x);
      if (instance.visibility->amodal_mask.covers(x, y)) whole[i] = 255;
      if (ids.at(x, y) == instance.id) visible[i] = 255;
    }
  }
  files.add(scene + "/mask/" + name, png_file(host_, ids.width(), ids.height(), whole));
  files.add(scene + "/mask_visib/" + name, png_file(host_, ids.width(), ids.height(), visible));
}

Json BopWriter::write_frame(const Capture& capture, std::size_t camera, CaptureFiles& files) const {
  const Frame& frame = capture.frames[camera];
  const std::string scene = std::string(split_folder(capture.index)) + "/" + scene_name(camera);
  const std::string stem = padded(capture.index, grown_padding(6, training_.capture_count()));
  files.add(scene + "/rgb/" + stem + "." + training_.image_format(),
            training_.image_file(host_, frame));
  const auto depth = depth_picture(frame.get(kDistanceToImagePlane), params_.depth_scale);
  files.add(scene + "/depth/" + stem + ".png", png_file(host_, depth, "depth"));

  Json poses = Json::array();
  Json infos = Json::array();
  for (const TrainingObject& object : training_.objects(frame)) {
    const Instance& instance = *object.instance;
    if (!instance.visibility || !instance.visibility->amodal_box) continue;
    std::int64_t valid = 0;
    const PixelBox& box = *instance.visibility->amodal_box;
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        if (instance.visibility->amodal_mask.covers(x, y) && depth.at(x, y) != 0) ++valid;
      }
    }
    add_masks(frame, instance, scene, stem + "_" + padded(int(poses.size()), 6) + ".png", files);
    poses.push_back(pose_json(frame, object, object_id(object)));
    infos.push_back(info_json(object, valid));
  }
  return {{"scene", scene},
          {"width", frame.camera.width},
          {"height", frame.camera.height},
          {"camera", camera_json(frame, params_.depth_scale)},
          {"gt", std::move(poses)},
          {"info", std::move(infos)}};
}

void BopWriter::write(const Capture& capture, CaptureFiles& files) const {
  Json record = Json::array();
  for (std::size_t camera = 0; camera < capture.frames.size(); ++camera) {
    record.push_back(write_frame(capture, camera, files));
  }
  files.record(python_json(record));
}

void BopWriter::finish(const RecordReader& records, DatasetFiles& files) {
  std::map<std::string, std::map<std::string, Json>> scene_files;  // scene -> file -> content
  std::map<int, Aabb> boxes;
  Json targets = Json::array();
  Json first_camera;
  records([&](int capture, std::string_view line) {
    for (Json& frame : Json::parse(line)) {
      const std::string scene = frame.at("scene");
      const std::string id = std::to_string(capture);
      auto& content = scene_files[scene];
      content["scene_camera"][id] = frame.at("camera");
      content["scene_gt"][id] = frame.at("gt");
      content["scene_gt_info"][id] = frame.at("info");
      for (const Json& pose : frame.at("gt")) {
        for (const char* bound : {"bounds_min", "bounds_max"}) {
          boxes[pose.at("obj_id")].add(vec3_of(pose.at(bound)));
        }
      }
      if (first_camera.is_null()) first_camera = frame;
      if (!scene.starts_with("test/")) continue;
      std::map<int, int> counts;
      for (const Json& pose : frame.at("gt")) ++counts[pose.at("obj_id")];
      for (const auto& [object, count] : counts) {
        targets.push_back({{"im_id", capture},
                           {"inst_count", count},
                           {"obj_id", object},
                           {"scene_id", std::stoi(scene.substr(5))}});
      }
    }
  });
  for (const auto& [scene, contents] : scene_files) {
    for (const auto& [name, json] : contents) {
      files.add_text(scene + "/" + name + ".json", python_json(json, 2) + "\n");
    }
  }
  Json infos = Json::object();
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const auto box = boxes.find(int(i) + 1);
    Json& info = infos[std::to_string(i + 1)];
    if (!objects_[i].info.is_null()) {
      info = objects_[i].info;
    } else if (box != boxes.end()) {
      info = model_json(box->second, box->second.size().norm());
    } else {
      infos.erase(std::to_string(i + 1));
    }
  }
  files.add_text("models/models_info.json", python_json(infos, 2) + "\n");
  files.add_text("test_targets_bop19.json", python_json(targets, 2) + "\n");
  if (first_camera.is_null()) return;
  const Json& k = first_camera.at("camera").at("cam_K");
  files.add_text("camera.json", python_json(Json{{"cx", k[2]},
                                                 {"cy", k[5]},
                                                 {"depth_scale", params_.depth_scale},
                                                 {"fx", k[0]},
                                                 {"fy", k[4]},
                                                 {"height", first_camera.at("height")},
                                                 {"width", first_camera.at("width")}},
                                            2) +
                                    "\n");
}

}  // namespace diorama
