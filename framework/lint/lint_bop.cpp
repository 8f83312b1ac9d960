// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "framework/lint/lint_formats.h"
#include "framework/lint/lint_page.h"
#include "framework/lint/object_checks.h"

namespace diorama::lint {
namespace {

PixelBox box_of(const Json& bbox) {
  const int x = bbox.at(0).get<int>();
  const int y = bbox.at(1).get<int>();
  return {x, y, x + bbox.at(2).get<int>(), y + bbox.at(3).get<int>()};
}

Mat3 matrix_of(const Json& list) {
  Mat3 matrix;
  for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = list.at(std::size_t(i)).get<double>();
  return matrix;
}

std::string padded_id(const std::string& id) {
  return id.size() < 6 ? std::string(6 - id.size(), '0') + id : id;
}

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
                "its targets are not the objects of test/*/scene_gt.json");
}

std::string model_file(const std::string& id) { return "models/obj_" + padded_id(id) + ".ply"; }

/// The number behind a line "element NAME" of a PLY file's header.
std::size_t ply_count(const std::string& header, const std::string& element) {
  const std::string line = "\nelement " + element + " ";
  const std::size_t at = header.find(line);
  if (at == std::string::npos) throw std::runtime_error("has no element " + element);
  return std::stoul(header.substr(at + line.size(), 20));
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
  /// Adds the scene's objects to `targets` when it is one to test on.
  BopScene(Dataset& dataset, std::string folder, const Json& models, TargetCounts& targets)
      : dataset_(dataset), folder_(std::move(folder)), models_(models), targets_(targets) {}

  void run() {
    const auto cameras = dataset_.json(folder_ + "/scene_camera.json");
    const auto poses = dataset_.json(folder_ + "/scene_gt.json");
    const auto infos = dataset_.json(folder_ + "/scene_gt_info.json");
    if (!cameras || !poses || !infos) return;
    dataset_.reading(folder_ + "/scene_gt.json", [&] {
      for (const auto& [id, list] : poses->items()) {
        lint_image(padded_id(id), cameras->at(id), list, infos->at(id));
        if (!folder_.starts_with("test/")) continue;
        for (const Json& pose : list) {
          ++targets_[{std::stoi(folder_.substr(5)), std::stoi(id), pose.at("obj_id").get<int>()}];
        }
      }
    });
  }

 private:
  void lint_image(const std::string& stem, const Json& camera, const Json& poses,
                  const Json& infos) {
    const std::string rgb = folder_ + "/rgb/" + stem;
    dataset_.check(dataset_.has(rgb + ".png") || dataset_.has(rgb + ".jpg"), "nothing is missing",
                   rgb, "the picture is missing");
    if (dataset_.has(rgb + ".png")) dataset_.picture(rgb + ".png");
    depth_file_ = folder_ + "/depth/" + stem + ".png";
    depth_ = dataset_.picture(depth_file_);
    depth_scale_ = camera.at("depth_scale").get<double>();
    if (!depth_) return;
    lens_ = lens_of(camera, depth_->width, depth_->height, matrix_of(camera.at("cam_K")));
    dataset_.check(poses.size() == infos.size(), "counts agree between files",
                   folder_ + "/scene_gt_info.json", "image " + stem + ": not one entry per object");
    for (std::size_t i = 0; i < poses.size() && i < infos.size(); ++i) {
      lint_object(stem + "_" + padded_id(std::to_string(i)) + ".png", poses[i], infos[i]);
    }
  }

  void lint_object(const std::string& name, const Json& pose, const Json& info) {
    const std::string file = folder_ + "/mask_visib/" + name;
    const auto visible = dataset_.picture(file);
    const auto whole = dataset_.picture(folder_ + "/mask/" + name);
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
    check_extent("bbox_visib", "px_count_visib", info, inner, file);
    check_extent("bbox_obj", "px_count_all", info, outer, folder_ + "/mask/" + name);
    check_pose(file, pose, outer.box, inner.box, *visible);
  }

  void check_extent(const char* box_key, const char* count_key, const Json& info,
                    const Extent& mask, const std::string& file) {
    const PixelBox box = box_of(info.at(box_key));
    dataset_.check(box == mask.box, "box = extent of mask", file,
                   std::string(box_key) + " " + box_text(box) + ", the mask extends over " +
                       box_text(mask.box));
    dataset_.check(info.at(count_key).get<std::int64_t>() == mask.count, "area = count", file,
                   std::string(count_key) + " " + info.at(count_key).dump() + ", the mask has " +
                       std::to_string(mask.count) + " pixels");
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
    seen.camera_from_local.linear() = rotation * vec3_of(pose.at("scale")).asDiagonal();
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
  std::set<std::string> scenes;
  for (const PlannedPicture& picture : page.pictures) {
    const std::string scene = (picture.split == "val" ? "test/" : "train_pbr/") +
                              padded_id(std::to_string(picture.camera));
    scenes.insert(scene);
    const std::string stem = scene + "/rgb/" + picture.stem.substr(0, picture.stem.find('_'));
    dataset.check(dataset.has(stem + ".png") || dataset.has(stem + ".jpg"), "nothing is missing",
                  stem, "the picture is missing");
  }
  const Json objects = lint_objects(dataset, page);
  if (const auto found = dataset.json("objects.json")) {
    dataset.check(*found == objects, "ids within the label map", "objects.json",
                  "its objects are not those of dataset.json");
  }
  dataset.json("camera.json");
  const auto models = dataset.json("models/models_info.json");
  const auto targets = dataset.json("test_targets_bop19.json");
  if (!models || !targets) return;
  dataset.reading("models/models_info.json", [&] { check_models(dataset, *models); });
  TargetCounts counts;
  for (const std::string& scene : scenes) BopScene(dataset, scene, *models, counts).run();
  dataset.reading("test_targets_bop19.json", [&] { check_targets(dataset, *targets, counts); });
}

}  // namespace diorama::lint
