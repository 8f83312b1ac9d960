// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_writer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "diorama/error.h"
#include "writer_bop/bop_format.h"
#include "writer_bop/bop_model.h"
#include "writer_bop/model_symmetries.h"
#include "writer_support/cuboid.h"
#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"
#include "writer_support/replicator.h"

namespace diorama {
namespace {

/// BOP's camera axes from ours: y and z change sign.
Affine bop_from_camera() {
  Affine map = Affine::Identity();
  map.linear() = Vec3(1.0, -1.0, -1.0).asDiagonal();
  return map;
}

constexpr const char* kLayouts[] = {"scenes", "cameras"};

Json camera_json(const Frame& frame, double depth_scale) {
  const Affine camera_from_world = bop_from_camera() * frame.world_from_camera.inverse();
  const Intrinsics k = intrinsics_of(frame.camera);
  Json json{{"cam_K", {k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0}},
            {"depth_scale", depth_scale},
            {"cam_R_w2c", flat_list(camera_from_world.linear())},
            {"cam_t_w2c", flat_list((kMillimetres * camera_from_world.translation()).transpose())}};
  if (frame.camera.lens != LensModel::Pinhole) json["lens"] = lens_json(frame.camera);
  return json;
}

/// Without what float arithmetic adds to a scale on its way through poses.
Vec3 tidy(const Vec3& scale) {
  return scale.unaryExpr([](double factor) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.6g", factor);
    return std::strtod(text.data(), nullptr);
  });
}

/// `scale` and the model's own obj_id are for finish(), which gives each size an id.
Json pose_json(const Frame& frame, const Instance& instance, int object_id, const Vec3& scale) {
  const Affine camera_from_model =
      bop_from_camera() * frame.world_from_camera.inverse() * instance.world_from_node;
  const Transform parts = Transform::from_affine(camera_from_model);
  Aabb bounds;
  for (const Vec3& corner : {instance.bounds_node.min, instance.bounds_node.max}) {
    bounds.add(kMillimetres * scale.cwiseProduct(corner));
  }
  return {{"cam_R_m2c", flat_list(parts.rotation.toRotationMatrix())},
          {"cam_t_m2c", flat_list((kMillimetres * parts.translation).transpose())},
          {"obj_id", object_id},
          {"bounds_min", flat_list(bounds.min.transpose())},
          {"bounds_max", flat_list(bounds.max.transpose())},
          {"node", instance.node_path},
          {"scale", flat_list(scale.transpose())}};
}

/// As the toolkit counts: from the first pixel to the last one.
Json box_json(const PixelBox& box) {
  return {box.x_min, box.y_min, box.width() - 1, box.height() - 1};
}

Json info_json(const Instance& instance, std::int64_t valid_pixels) {
  const Visibility& visibility = *instance.visibility;
  const std::int64_t all = visibility.amodal_pixels + visibility.outside_pixels;
  return {{"bbox_obj", box_json(*visibility.whole_box)},
          {"bbox_visib", box_json(*instance.tight_box)},
          {"px_count_all", all},
          {"px_count_valid", valid_pixels},
          {"px_count_visib", visibility.visible_pixels},
          {"visib_fract", double(visibility.visible_pixels) / double(all)}};
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

/// A JSON object or list that grows line by line.
class JsonLines {
 public:
  JsonLines(DatasetFiles& files, std::string path, const char* brackets)
      : files_(files), path_(std::move(path)), brackets_(brackets) {}
  void add(std::string_view text) {
    put(is_empty_ ? std::string(1, brackets_[0]) + "\n  " : std::string(",\n  "));
    put(text);
    is_empty_ = false;
  }
  void add(int key, const Json& value) {
    add("\"" + std::to_string(key) + "\": " + python_json(value));
  }
  void end() {
    put(is_empty_ ? std::string(brackets_) + "\n" : std::string("\n") + brackets_[1] + "\n");
  }

 private:
  void put(std::string_view text) { files_.append_text(path_, text); }

  DatasetFiles& files_;
  std::string path_;
  const char* brackets_;
  bool is_empty_ = true;
};

}  // namespace

void BopWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  v.param("depth_scale", depth_scale,
          {"Millimetres per unit of the depth pictures; 0.1 reaches 6.5 m.", "mm", 0.001, 1000.0});
  v.choice(
      "layout", layout, kLayouts,
      {"With several cameras: scenes: each is a scene; cameras: their names stand behind those "
       "of folders and files of one scene."});
  v.param("max_models", max_models,
          {"Objects in more sizes than this end the job: each size needs a model of its own.", "",
           1.0, 1e6});
  v.param("symmetry_tolerance", symmetry_tolerance,
          {"How far a turned model's surface may be from itself, as a share of the diameter; 0: no "
           "symmetries are looked for.",
           "", 0.0, 0.2});
}

BopWriter::BopWriter(Params params, Host& host)
    : params_(std::move(params)),
      host_(host),
      training_(params_.training),
      sizes_(std::make_unique<Sizes>()) {}

NameSet BopWriter::needs() const {
  return {std::string(kColor.name),
          std::string(kInstanceId.name),
          std::string(kDistanceToImagePlane.name),
          "instances",
          "visibility",
          "amodal_mask"};
}

std::string BopWriter::scene_folder(int capture, std::size_t camera) const {
  const bool is_test = std::string_view(training_.split(capture)) == "val";
  const std::size_t scene = params_.layout == "scenes" ? camera : 0;
  return std::string(is_test ? "test" : "train_pbr") + "/" + padded(int(scene), 6) + "/";
}

std::string BopWriter::camera_suffix(std::size_t camera) const {
  const bool has_one = params_.layout == "scenes" || cameras_.size() < 2;
  return has_one ? std::string() : "_" + cameras_[camera];
}

void BopWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  cameras_ = dataset.camera_names;
  find_objects(dataset);
  Json objects = Json::array();
  for (const Object& object : objects_) {
    const std::string& name = training_.classes()[std::size_t(object.class_index)];
    objects.push_back({{"obj_id", int(objects.size()) + 1}, {"class", name}});
    if (!object.asset.empty()) objects.back()["model"] = object.asset;
  }
  const bool is_sensors = params_.layout == "cameras";
  training_.add_dataset_page(
      "BOP",
      {{"units", "millimetres"},
       {"camera_axes", "x right, y down, z forward"},
       {"pose", "point_camera = R point_model + t; models have the size of their objects"},
       {"boxes", "x, y, width, height; widths are those of the last pixel minus the first"},
       {"silhouettes",
        "px_count_all, visib_fract and bbox_obj count what lies up to one image size "
        "outside of the picture"},
       {"depth", "along the viewing axis, 16 bit x depth_scale, 0: nothing"},
       {"symmetry_tolerance", params_.symmetry_tolerance},
       {"scene", is_sensors ? "all cameras, by suffixes; image ids are captures"
                            : "one camera; image ids are captures"},
       {"objects", std::move(objects)}},
      dataset, files);
}

BopModel BopWriter::load_model(const std::string& asset) const {
  Scene scene;
  return bop_model(scene, host_.load_asset(asset, scene, scene.root()));
}

void BopWriter::find_objects(const DatasetInfo& dataset) {
  objects_.clear();
  for (int index = 0; index < int(training_.classes().size()); ++index) {
    const std::size_t before = objects_.size();
    for (const DatasetAsset& asset : dataset.assets) {
      if (std::ranges::count(training_.classes_of(asset.labels), index) == 0) continue;
      const BopModel model = load_model(asset.asset);
      if (model.is_empty()) continue;
      const Aabb box = model.bounds();
      objects_.push_back({index, asset.asset, {box.min / kMillimetres, box.max / kMillimetres}});
    }
    if (objects_.size() == before) objects_.push_back({index, {}, {}});
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

/// Ends the job early instead of after its last capture.
void BopWriter::note_size(int id, const Vec3& scale) const {
  if (objects_[std::size_t(id - 1)].asset.empty()) return;
  const std::lock_guard lock(sizes_->mutex);
  sizes_->seen.emplace(id, std::array{scale.x(), scale.y(), scale.z()});
  if (sizes_->seen.size() <= std::size_t(params_.max_models)) return;
  throw Error(
      ErrorKind::Config,
      "max_models: objects come in more than " + std::to_string(params_.max_models) +
          " sizes, and BOP needs a model of each; draw their scales from a 'choice' of few, "
          "or raise max_models");
}

void BopWriter::add_masks(const Frame& frame, const Instance& instance, const std::string& folder,
                          const std::string& suffix, const std::string& name,
                          CaptureFiles& files) const {
  const auto& ids = frame.get(kInstanceId);
  const Visibility& visibility = *instance.visibility;
  std::vector<std::uint8_t> mask(ids.pixels().size(), 0);
  const PixelBox& box = *visibility.amodal_box;
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) {
      if (!visibility.amodal_mask.covers(x, y)) continue;
      mask[std::size_t(y) * std::size_t(ids.width()) + std::size_t(x)] = 255;
    }
  }
  files.add(folder + "mask" + suffix + "/" + name,
            png_file(host_, ids.width(), ids.height(), mask));
  for (std::size_t i = 0; i < mask.size(); ++i) {
    mask[i] = ids.pixels()[i] == instance.id ? 255 : 0;
  }
  files.add(folder + "mask_visib" + suffix + "/" + name,
            png_file(host_, ids.width(), ids.height(), mask));
}

Json BopWriter::write_frame(const Capture& capture, std::size_t camera, CaptureFiles& files) const {
  const Frame& frame = capture.frames[camera];
  const std::string folder = scene_folder(capture.index, camera);
  const std::string suffix = camera_suffix(camera);
  const std::string stem = padded(capture.index, grown_padding(6, training_.capture_count()));
  const Image<std::uint32_t> depth =
      depth_picture(frame.get(kDistanceToImagePlane), params_.depth_scale);
  files.add(folder + "rgb" + suffix + "/" + stem + "." + training_.image_format(),
            training_.image_file(host_, frame));
  files.add(folder + "depth" + suffix + "/" + stem + ".png", png_file(host_, depth, "depth"));

  Json poses = Json::array();
  Json infos = Json::array();
  for (const TrainingObject& object : training_.objects(frame)) {
    const Instance& instance = *object.instance;
    if (!instance.visibility || !instance.visibility->amodal_box) continue;
    if (!has_pose(instance)) {
      throw Error(ErrorKind::Config, frame.camera_name + ": nothing tells where " +
                                         instance.node_path +
                                         " lies, and BOP has nothing to say but poses");
    }
    std::int64_t valid = 0;
    const PixelBox& box = *instance.visibility->amodal_box;
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        if (instance.visibility->amodal_mask.covers(x, y) && depth.at(x, y) != 0) ++valid;
      }
    }
    const std::string name = stem + "_" + padded(int(poses.size()), 6) + ".png";
    add_masks(frame, instance, folder, suffix, name, files);
    const int id = object_id(object);
    const Vec3 scale = tidy(Transform::from_affine(instance.world_from_node).scale);
    note_size(id, scale);
    poses.push_back(pose_json(frame, instance, id, scale));
    infos.push_back(info_json(instance, valid));
  }
  return {{"camera", camera},
          {"width", frame.camera.width},
          {"height", frame.camera.height},
          {"scene_camera", camera_json(frame, params_.depth_scale)},
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

/// Makes the files that all captures share, from one record after the other.
class BopWriter::Finish {
 public:
  Finish(const BopWriter& writer, DatasetFiles& files)
      : writer_(writer),
        files_(files),
        localization_(files, "test_targets_bop19.json", "[]"),
        detection_(files, "test_targets_bop24.json", "[]"),
        next_id_(int(writer.objects_.size()) + 1) {}

  void add(int capture, Json& frame) {
    const std::size_t camera = frame.at("camera");
    for (Json& pose : frame.at("gt")) give_id(pose);
    const std::string folder = writer_.scene_folder(capture, camera);
    const std::string end = writer_.camera_suffix(camera) + ".json";
    for (const auto& [name, key] :
         {std::pair("scene_camera", "scene_camera"), std::pair("scene_gt", "gt"),
          std::pair("scene_gt_info", "info")}) {
      const std::string path = folder + name + end;
      scene_files_.try_emplace(path, files_, path, "{}").first->second.add(capture, frame.at(key));
    }
    if (folder.starts_with("test/")) add_targets(capture, folder, camera, frame);
    cameras_.try_emplace(camera, simulated_camera(frame));
  }

  void end() {
    for (auto& [path, file] : scene_files_) file.end();
    localization_.end();
    detection_.end();
    add_models();
    for (const auto& [camera, json] : cameras_) {
      const std::string text = python_json(json, 2) + "\n";
      if (camera == cameras_.begin()->first) files_.add_text("camera.json", text);
      if (writer_.cameras_.size() > 1) {
        files_.add_text("camera_" + writer_.cameras_[camera] + ".json", text);
      }
    }
  }

 private:
  using Scale = std::array<double, 3>;

  /// The first scale of an object has the object's own id, further ones those behind all objects.
  void give_id(Json& pose) {
    const int own = pose.at("obj_id");
    const Scale scale = pose.at("scale");
    if (scale == Scale{1.0, 1.0, 1.0}) pose.erase("scale");
    if (writer_.objects_.at(std::size_t(own - 1)).asset.empty()) {
      for (const char* bound : {"bounds_min", "bounds_max"}) {
        boxes_[own].add(vec3_of(pose.at(bound)));
      }
      return;
    }
    auto& ids = ids_[own];
    const auto [found, is_new] = ids.try_emplace(scale, ids.empty() ? own : next_id_);
    if (is_new && found->second == next_id_) ++next_id_;
    pose["obj_id"] = found->second;
  }

  /// What the benchmark asks for: objects by number, and pictures. Of several sensors of a scene,
  /// the first one counts.
  void add_targets(int capture, const std::string& folder, std::size_t camera, const Json& frame) {
    if (writer_.params_.layout == "cameras" && camera > 0) return;
    const int scene = std::stoi(folder.substr(5));
    detection_.add(python_json(Json{{"im_id", capture}, {"scene_id", scene}}));
    std::map<int, int> counts;
    for (std::size_t i = 0; i < frame.at("gt").size(); ++i) {
      const double visible = frame.at("info").at(i).at("visib_fract");
      if (visible >= kLeastVisibleTarget) ++counts[frame.at("gt")[i].at("obj_id")];
    }
    for (const auto& [object, count] : counts) {
      localization_.add(python_json(Json{
          {"im_id", capture}, {"inst_count", count}, {"obj_id", object}, {"scene_id", scene}}));
    }
  }

  Json simulated_camera(const Json& frame) const {
    const Json& k = frame.at("scene_camera").at("cam_K");
    return {{"cx", k[2]},
            {"cy", k[5]},
            {"depth_scale", writer_.params_.depth_scale},
            {"fx", k[0]},
            {"fy", k[4]},
            {"height", frame.at("height")},
            {"width", frame.at("width")}};
  }

  void add_symmetries(const BopModel& model, Json& info) const {
    const double diameter = info.at("diameter");
    const ModelSymmetries symmetries =
        find_symmetries(model, writer_.params_.symmetry_tolerance * diameter);
    for (const Affine& map : symmetries.discrete) {
      info["symmetries_discrete"].push_back(flat_list(map.matrix()));
    }
    for (const auto& [direction, point] : symmetries.continuous) {
      info["symmetries_continuous"].push_back(
          {{"axis", flat_list(direction.transpose())}, {"offset", flat_list(point.transpose())}});
    }
  }

  void add_models() {
    std::map<int, Json> infos;
    std::map<int, int> object_of_id;
    for (int own = 1; own <= int(writer_.objects_.size()); ++own) {
      const Object& object = writer_.objects_[std::size_t(own - 1)];
      object_of_id[own] = own;
      if (object.asset.empty()) {
        const auto box = boxes_.find(own);
        if (box == boxes_.end()) continue;
        infos[own] = model_json(box->second, box->second.size().norm());
        continue;
      }
      const BopModel model = writer_.load_model(object.asset);
      auto& ids = ids_[own];
      if (ids.empty()) ids.emplace(Scale{1.0, 1.0, 1.0}, own);
      for (const auto& [scale, id] : ids) {
        const BopModel scaled = model.scaled(Vec3(scale[0], scale[1], scale[2]));
        infos[id] = model_json(scaled.bounds(), scaled.diameter());
        add_symmetries(scaled, infos[id]);
        if (scale != Scale{1.0, 1.0, 1.0}) infos[id]["scale"] = scale;
        if (id != own) infos[id]["unscaled_as"] = own;
        object_of_id[id] = own;
        files_.add(model_file(id), scaled.ply());
      }
    }
    Json names = Json::object();
    for (const auto& [id, own] : object_of_id) {
      const int index = writer_.objects_[std::size_t(own - 1)].class_index;
      names[std::to_string(id)] = writer_.training_.classes()[std::size_t(index)];
    }
    files_.add_text("objects.json", python_json(names, 2) + "\n");
    Json page = Json::object();
    for (auto& [id, info] : infos) page[std::to_string(id)] = std::move(info);
    files_.add_text("models/models_info.json", python_json(page, 2) + "\n");
  }

  const BopWriter& writer_;
  DatasetFiles& files_;
  std::map<std::string, JsonLines> scene_files_;
  JsonLines localization_;
  JsonLines detection_;
  std::map<std::size_t, Json> cameras_;
  std::map<int, Aabb> boxes_;                ///< Of objects without a model.
  std::map<int, std::map<Scale, int>> ids_;  ///< By object.
  int next_id_;
};

void BopWriter::finish(const RecordReader& records, DatasetFiles& files) {
  Finish finish(*this, files);
  records([&](int capture, std::string_view line) {
    for (Json& frame : Json::parse(line)) finish.add(capture, frame);
  });
  finish.end();
}

}  // namespace diorama
