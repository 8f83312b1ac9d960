// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string_view>

#include "framework/lint/lint_formats.h"
#include "framework/lint/lint_page.h"
#include "framework/lint/object_checks.h"

namespace diorama::lint {
namespace {

/// BOP's widths are differences of the first and the last pixel.
PixelBox box_of(const Json& bbox) {
  const int x = bbox.at(0).get<int>();
  const int y = bbox.at(1).get<int>();
  return {x, y, x + bbox.at(2).get<int>() + 1, y + bbox.at(3).get<int>() + 1};
}

Mat3 matrix_of(const Json& list) {
  Mat3 matrix;
  for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = list.at(std::size_t(i)).get<double>();
  return matrix;
}

std::string padded_id(const std::string& id) {
  return id.size() < 6 ? std::string(6 - id.size(), '0') + id : id;
}

/// Of the benchmark's targets.
constexpr double kLeastVisibleTarget = 0.1;

/// Objects of the scenes to test on, by scene, image and object.
using TargetCounts = std::map<std::array<int, 3>, int>;

void check_targets(Dataset& dataset, const Json& targets, const TargetCounts& expected) {
  TargetCounts found;
  for (const Json& target : targets) {
    const std::array key{target.at("scene_id").get<int>(), target.at("im_id").get<int>(),
                         target.at("obj_id").get<int>()};
    found[key] += target.at("inst_count").get<int>();
  }
  dataset.check(found == expected, "counts agree between files", "test_targets_bop19.json",
                "its targets are not the objects of test/*/scene_gt.json that are at least " +
                    std::to_string(int(100.0 * kLeastVisibleTarget)) + " % visible");
}

std::string model_file(const std::string& id) { return "models/obj_" + padded_id(id) + ".ply"; }

/// The number behind a line "element NAME" of a PLY file's header.
std::size_t ply_count(const std::string& header, const std::string& element) {
  const std::string line = "\nelement " + element + " ";
  const std::size_t at = header.find(line);
  if (at == std::string::npos) throw std::runtime_error("has no element " + element);
  std::size_t count = 0;
  const char* begin = header.data() + at + line.size();
  if (std::from_chars(begin, header.data() + header.size(), count).ec != std::errc()) {
    throw std::runtime_error("has no number of elements " + element);
  }
  return count;
}

/// The extent of a model's vertices. They begin with three floats and take 27 bytes each, faces 13.
Aabb ply_extent(const std::string& file) {
  constexpr std::string_view kEnd = "\nend_header\n";
  const std::size_t end = file.find(kEnd);
  if (!file.starts_with("ply\nformat binary_little_endian 1.0\n") || end == std::string::npos) {
    throw std::runtime_error("is not a binary PLY file");
  }
  const std::string header = file.substr(0, end);
  const std::size_t data = end + kEnd.size();
  const std::size_t vertices = ply_count(header, "vertex");
  if ((file.size() - data) / 27 < vertices ||
      file.size() - data - 27 * vertices != 13 * ply_count(header, "face")) {
    throw std::runtime_error("is cut short");
  }
  Aabb box;
  for (std::size_t i = 0; i < vertices; ++i) {
    Vec3f position;
    std::memcpy(position.data(), file.data() + data + 27 * i, 12);
    box.add(position.cast<double>());
  }
  return box;
}

Aabb model_box(const Json& model) {
  const Vec3 lo(model.at("min_x").get<double>(), model.at("min_y").get<double>(),
                model.at("min_z").get<double>());
  const Vec3 size(model.at("size_x").get<double>(), model.at("size_y").get<double>(),
                  model.at("size_z").get<double>());
  return {lo, lo + size};
}

/// Every model is as large as models_info says.
void check_models(Dataset& dataset, const Json& models) {
  const std::string page = "models/models_info.json";
  for (const auto& [id, model] : models.items()) {
    const Aabb box = model_box(model);
    const double diameter = model.at("diameter").get<double>();
    dataset.check(diameter <= box.size().norm() * (1.0 + 1e-5) &&
                      diameter >= box.size().maxCoeff() * (1.0 - 1e-5),
                  "counts agree between files", page,
                  "obj_id " + id + ": diameter and size differ");
    const std::string file = model_file(id);
    if (!dataset.has(file)) continue;
    const auto text = dataset.text(file);
    if (!text) continue;
    dataset.reading(file, [&] {
      const Aabb extent = ply_extent(*text);
      const double slack = 1e-5 * box.size().norm();
      dataset.check(
          (extent.min - box.min).norm() <= slack && (extent.max - box.max).norm() <= slack,
          "counts agree between files", file, "is not as large as " + page + " says");
    });
  }
}

class BopScene {
 public:
  /// `suffix` stands behind names where several cameras share a scene. Adds the scene's objects to
  /// `targets` when it is one to test on; of several cameras, the first one is.
  BopScene(Dataset& dataset, std::string folder, std::string suffix, bool has_targets,
           const Json& models, TargetCounts& targets)
      : dataset_(dataset),
        folder_(std::move(folder)),
        suffix_(std::move(suffix)),
        has_targets_(has_targets && folder_.starts_with("test/")),
        models_(models),
        targets_(targets) {}

  void run() {
    const std::string end = suffix_ + ".json";
    const auto cameras = dataset_.json(folder_ + "/scene_camera" + end);
    const auto poses = dataset_.json(folder_ + "/scene_gt" + end);
    const auto infos = dataset_.json(folder_ + "/scene_gt_info" + end);
    if (!cameras || !poses || !infos) return;
    dataset_.reading(folder_ + "/scene_gt" + end, [&] {
      for (const auto& [id, list] : poses->items()) {
        lint_image(padded_id(id), cameras->at(id), list, infos->at(id));
        if (!has_targets_) continue;
        for (std::size_t i = 0; i < list.size(); ++i) {
          const double visible = infos->at(id).at(i).at("visib_fract").get<double>();
          if (visible < kLeastVisibleTarget) continue;
          ++targets_[{std::stoi(folder_.substr(5)), std::stoi(id),
                      list[i].at("obj_id").get<int>()}];
        }
      }
    });
  }

 private:
  std::string place(const char* kind, const std::string& name) const {
    return folder_ + "/" + kind + suffix_ + "/" + name;
  }

  void lint_image(const std::string& stem, const Json& camera, const Json& poses,
                  const Json& infos) {
    const std::string rgb = place("rgb", stem);
    dataset_.check(dataset_.has(rgb + ".png") || dataset_.has(rgb + ".jpg"), "nothing is missing",
                   rgb, "the picture is missing");
    if (dataset_.has(rgb + ".png")) dataset_.picture(rgb + ".png");
    depth_file_ = place("depth", stem + ".png");
    depth_ = dataset_.picture(depth_file_);
    depth_scale_ = camera.at("depth_scale").get<double>();
    if (!depth_) return;
    lens_ = lens_of(camera, depth_->width, depth_->height, matrix_of(camera.at("cam_K")));
    dataset_.check(poses.size() == infos.size(), "counts agree between files",
                   folder_ + "/scene_gt_info" + suffix_ + ".json",
                   "image " + stem + ": not one entry per object");
    for (std::size_t i = 0; i < poses.size() && i < infos.size(); ++i) {
      lint_object(stem + "_" + padded_id(std::to_string(i)) + ".png", poses[i], infos[i]);
    }
  }

  void lint_object(const std::string& name, const Json& pose, const Json& info) {
    const std::string file = place("mask_visib", name);
    const auto visible = dataset_.picture(file);
    const auto whole = dataset_.picture(place("mask", name));
    if (!visible || !whole) return;
    if (!visible->has_size_of(*whole) || !depth_->has_size_of(*whole)) {
      dataset_.find("counts agree between files", file, "masks and depth differ in size");
      return;
    }
    std::size_t beyond = 0;
    Extent inner, outer;
    for (int y = 0; y < visible->height; ++y) {
      for (int x = 0; x < visible->width; ++x) {
        if (visible->at(x, y) != 0) inner.add(x, y);
        if (whole->at(x, y) != 0) outer.add(x, y);
        if (visible->at(x, y) != 0 && whole->at(x, y) == 0) ++beyond;
      }
    }
    dataset_.check(beyond == 0, "visible <= amodal", file,
                   std::to_string(beyond) + " pixels lie outside the whole object's mask");
    const PixelBox box = box_of(info.at("bbox_visib"));
    dataset_.check(
        box == inner.box, "box = extent of mask", file,
        "bbox_visib " + box_text(box) + ", the mask extends over " + box_text(inner.box));
    dataset_.check(info.at("px_count_visib").get<std::int64_t>() == inner.count, "area = count",
                   file,
                   "px_count_visib " + info.at("px_count_visib").dump() + ", the mask has " +
                       std::to_string(inner.count) + " pixels");
    check_silhouette(info, outer, place("mask", name));
    check_pose(file, pose, outer.box, inner.box, *visible);
  }

  /// Of the silhouette only what lies inside the picture is in the mask.
  void check_silhouette(const Json& info, const Extent& mask, const std::string& file) {
    const PixelBox box = box_of(info.at("bbox_obj"));
    const PixelBox inside = box.clipped(depth_->width, depth_->height);
    // What is cut off may be wider than what is left.
    const bool is_whole = inside == box;
    const bool holds = mask.box.x_min >= inside.x_min && mask.box.y_min >= inside.y_min &&
                       mask.box.x_max <= inside.x_max && mask.box.y_max <= inside.y_max;
    dataset_.check(is_whole ? box == mask.box : holds, "box = extent of mask", file,
                   "bbox_obj " + box_text(box) + ", the mask extends over " + box_text(mask.box));
    const auto all = info.at("px_count_all").get<std::int64_t>();
    dataset_.check(is_whole ? all == mask.count : all > mask.count, "area = count", file,
                   "px_count_all " + std::to_string(all) + ", the mask has " +
                       std::to_string(mask.count) + " pixels" +
                       (is_whole ? "" : " of a silhouette that is cut off"));
    const double share = info.at("px_count_visib").get<double>() / double(all);
    dataset_.check(
        std::abs(info.at("visib_fract").get<double>() - share) < 1e-6, "area = count", file,
        "visib_fract " + info.at("visib_fract").dump() + " is not px_count_visib / px_count_all");
  }

  void check_pose(const std::string& file, const Json& pose, const PixelBox& whole_box,
                  const PixelBox& visible_box, const Picture& visible) {
    const std::string id = pose.at("obj_id").dump();
    dataset_.check(models_.contains(id), "ids within the label map", file,
                   "obj_id " + id + " is not in models_info.json");
    SeenObject seen;
    seen.who = pose.at("node").get<std::string>();
    seen.file = file;
    const Mat3 rotation = matrix_of(pose.at("cam_R_m2c"));
    dataset_.check((rotation * rotation.transpose() - Mat3::Identity()).norm() < 1e-4 &&
                       rotation.determinant() > 0.0,
                   "pose agrees with the keypoints", file, "cam_R_m2c is not a rotation");
    seen.camera_from_local.linear() = rotation;
    seen.camera_from_local.translation() = vec3_of(pose.at("cam_t_m2c"));
    seen.bounds = {vec3_of(pose.at("bounds_min")), vec3_of(pose.at("bounds_max"))};
    seen.box = whole_box;
    check_reprojection(dataset_, lens_, seen);
    seen.box = visible_box;
    seen.has = [&](int x, int y) { return visible.at(x, y) != 0; };
    const auto depth = [this](int x, int y) {
      const std::uint32_t value = depth_->at(x, y);
      return value == 0 ? kInfinity : depth_scale_ * value;
    };
    check_depth(dataset_, lens_, seen, {depth_file_, false, 0.5 * depth_scale_, depth});
    if (models_.contains(id)) check_model(models_.at(id), seen);
  }

  /// The model's box holds that of every instance.
  void check_model(const Json& model, const SeenObject& seen) {
    const Aabb box = model_box(model);
    const double slack = 1e-5 * box.size().norm();
    const bool holds = ((seen.bounds.min - box.min).array() >= -slack).all() &&
                       ((box.max - seen.bounds.max).array() >= -slack).all();
    dataset_.check(holds, "counts agree between files", "models/models_info.json",
                   seen.who + ": its bounds are not inside those of its model");
  }

  Dataset& dataset_;
  std::string folder_;
  std::string suffix_;
  bool has_targets_;
  const Json& models_;
  TargetCounts& targets_;
  std::string depth_file_;
  std::optional<Picture> depth_;
  double depth_scale_ = 1.0;
  Lens lens_;
};

/// Names by obj_id as dataset.json has them; their models must be there.
Json lint_objects(Dataset& dataset, const DatasetPage& page) {
  Json names = Json::object();
  dataset.reading("dataset.json", [&] {
    std::set<std::string> classes(page.classes.begin(), page.classes.end());
    for (const Json& object : page.conventions.at("objects")) {
      const std::string id = object.at("obj_id").dump();
      const std::string name = object.at("class").get<std::string>();
      names[id] = name;
      dataset.check(std::ranges::count(page.classes, name) == 1, "ids within the label map",
                    "dataset.json",
                    "object " + id + " is of the class " + name + ", which is none");
      classes.erase(name);
      const std::string file = model_file(id);
      dataset.check(dataset.has(file) || !object.contains("model"), "nothing is missing", file,
                    "the model is missing");
    }
    dataset.check(classes.empty(), "ids within the label map", "dataset.json",
                  std::to_string(classes.size()) + " classes have no object");
  });
  return names;
}

}  // namespace

void lint_bop(Dataset& dataset) {
  const DatasetPage page = lint_page(dataset);
  // One scene per camera, or all cameras as sensors of scene 0.
  const auto scene_of = [](const PlannedPicture& picture, int number) {
    return (picture.split == "val" ? "test/" : "train_pbr/") + padded_id(std::to_string(number));
  };
  std::map<std::pair<std::string, std::string>, bool> scenes;  // folder, suffix: has targets
  for (const PlannedPicture& picture : page.pictures) {
    const std::size_t stem_end = picture.stem.find('_');
    const std::string suffix = picture.stem.substr(stem_end);
    const bool is_sensor = dataset.has(scene_of(picture, 0) + "/scene_gt" + suffix + ".json");
    const std::string folder = scene_of(picture, is_sensor ? 0 : picture.camera);
    scenes[{folder, is_sensor ? suffix : ""}] = !is_sensor || picture.camera == 0;
    const std::string stem =
        folder + "/rgb" + (is_sensor ? suffix : "") + "/" + picture.stem.substr(0, stem_end);
    dataset.check(dataset.has(stem + ".png") || dataset.has(stem + ".jpg"), "nothing is missing",
                  stem, "the picture is missing");
  }
  const Json objects = lint_objects(dataset, page);
  if (const auto found = dataset.json("objects.json")) {
    // Objects of further sizes come behind those of the page.
    bool holds_all = true;
    for (const auto& [id, name] : objects.items()) {
      holds_all &= found->contains(id) && found->at(id) == name;
    }
    dataset.check(holds_all, "ids within the label map", "objects.json",
                  "its objects are not those of dataset.json");
  }
  dataset.json("camera.json");
  for (const PlannedPicture& picture : page.pictures) {
    if (page.cameras < 2 || picture.capture > 0) continue;
    dataset.json("camera" + picture.stem.substr(picture.stem.find('_')) + ".json");
  }
  const auto models = dataset.json("models/models_info.json");
  const auto targets = dataset.json("test_targets_bop19.json");
  dataset.json("test_targets_bop24.json");
  if (!models || !targets) return;
  dataset.reading("models/models_info.json", [&] { check_models(dataset, *models); });
  TargetCounts counts;
  for (const auto& [scene, has_targets] : scenes) {
    BopScene(dataset, scene.first, scene.second, has_targets, *models, counts).run();
  }
  dataset.reading("test_targets_bop19.json", [&] { check_targets(dataset, *targets, counts); });
}

}  // namespace diorama::lint
