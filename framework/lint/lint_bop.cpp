// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "framework/lint/lint_formats.h"

namespace diorama::lint {
namespace {

constexpr const char* kReproject = "pose and camera reproject onto the mask";

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

Vec3 vec3_of(const Json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

std::string padded_id(const std::string& id) {
  return id.size() < 6 ? std::string(6 - id.size(), '0') + id : id;
}

class BopScene {
 public:
  BopScene(Dataset& dataset, std::string folder, const Json& models)
      : dataset_(dataset), folder_(std::move(folder)), models_(models) {}

  void run() {
    const auto cameras = dataset_.json(folder_ + "/scene_camera.json");
    const auto poses = dataset_.json(folder_ + "/scene_gt.json");
    const auto infos = dataset_.json(folder_ + "/scene_gt_info.json");
    if (!cameras || !poses || !infos) return;
    dataset_.reading(folder_ + "/scene_gt.json", [&] {
      for (const auto& [id, list] : poses->items()) {
        lint_image(padded_id(id), cameras->at(id), list, infos->at(id));
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
    camera_ = matrix_of(camera.at("cam_K"));
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
    if (!visible->has_size_of(*whole) || (depth_ && !depth_->has_size_of(*whole))) {
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
    check_pose(file, pose, outer.box, *visible);
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

  void check_pose(const std::string& file, const Json& pose, const PixelBox& mask,
                  const Picture& visible) {
    const std::string id = pose.at("obj_id").dump();
    dataset_.check(models_.contains(id), "ids within the label map", file,
                   "obj_id " + id + " is not in models_info.json");
    if (!models_.contains(id)) return;
    const Json& model = models_.at(id);
    Aabb box;
    box.min = {model.at("min_x").get<double>(), model.at("min_y").get<double>(),
               model.at("min_z").get<double>()};
    box.max = box.min + Vec3(model.at("size_x").get<double>(), model.at("size_y").get<double>(),
                             model.at("size_z").get<double>());
    Affine camera_from_model = Affine::Identity();
    const Mat3 rotation = matrix_of(pose.at("cam_R_m2c"));
    dataset_.check((rotation * rotation.transpose() - Mat3::Identity()).norm() < 1e-4 &&
                       rotation.determinant() > 0.0,
                   "pose agrees with the keypoints", file, "cam_R_m2c is not a rotation");
    camera_from_model.linear() = rotation * vec3_of(pose.at("scale")).asDiagonal();
    camera_from_model.translation() = vec3_of(pose.at("cam_t_m2c"));
    check_projection(file, camera_from_model, box, mask);
    check_depth(camera_from_model.inverse(), box, visible);
  }

  void check_projection(const std::string& file, const Affine& camera_from_model, const Aabb& box,
                        const PixelBox& mask) {
    Eigen::AlignedBox2d projected;
    for (int i = 0; i < 8; ++i) {
      const Vec3 corner = camera_from_model * box.corner(i);
      if (corner.z() <= 1.0) return;
      projected.extend((camera_ * corner).hnormalized());
    }
    const bool holds =
        projected.min().x() <= mask.x_min + 1.1 && projected.min().y() <= mask.y_min + 1.1 &&
        projected.max().x() >= mask.x_max - 1.1 && projected.max().y() >= mask.y_max - 1.1;
    dataset_.check(holds, kReproject, file,
                   "the model's box does not project onto the mask " + box_text(mask));
  }

  void check_depth(const Affine& model_from_camera, const Aabb& box, const Picture& visible) {
    if (!depth_) return;
    const Mat3 inverse = camera_.inverse();
    // Half a unit of the depth picture, and the model's box of another instance of the class.
    const Vec3 slack = 0.01 * box.size() + Vec3::Constant(depth_scale_ + 1.0);
    std::size_t wrong = 0;
    std::size_t all = 0;
    for (int y = 0; y < visible.height; ++y) {
      for (int x = 0; x < visible.width; ++x) {
        if (visible.at(x, y) == 0 || depth_->at(x, y) == 0) continue;
        const Vec3 ray = inverse * Vec3(x + 0.5, y + 0.5, 1.0);
        const Vec3 point = model_from_camera * (ray * (depth_scale_ * depth_->at(x, y)));
        ++all;
        if (!((point - box.min + slack).array() >= 0.0).all() ||
            !((box.max + slack - point).array() >= 0.0).all()) {
          ++wrong;
        }
      }
    }
    dataset_.check(wrong == 0, "depth back-projects", depth_file_,
                   std::to_string(wrong) + " of " + std::to_string(all) +
                       " points of an object lie outside its model's box");
  }

  Dataset& dataset_;
  std::string folder_;
  const Json& models_;
  std::string depth_file_;
  std::optional<Picture> depth_;
  double depth_scale_ = 1.0;
  Mat3 camera_ = Mat3::Identity();
};

}  // namespace

void lint_bop(Dataset& dataset) {
  const auto models = dataset.json("models/models_info.json");
  if (!models) return;
  bool is_any = false;
  for (const std::string& file : dataset.files()) {
    if (!file.ends_with("/scene_gt.json")) continue;
    is_any = true;
    BopScene(dataset, std::filesystem::path(file).parent_path().generic_string(), *models).run();
  }
  dataset.check(is_any, "nothing is missing", ".", "no scene_gt.json: was the run finished?");
}

}  // namespace diorama::lint
