// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/replicator_files.h"

#include <algorithm>
#include <array>

namespace diorama::lint {
namespace {

// Longer stems first where one ends with another.
constexpr std::array kStems{"instance_segmentation_semantics_mapping",
                            "instance_id_segmentation_mapping",
                            "instance_segmentation_mapping",
                            "semantic_segmentation_labels",
                            "instance_id_segmentation",
                            "instance_segmentation",
                            "semantic_segmentation",
                            "bounding_box_2d_tight_prim_paths",
                            "bounding_box_2d_loose_prim_paths",
                            "bounding_box_3d_prim_paths",
                            "bounding_box_2d_tight_labels",
                            "bounding_box_2d_loose_labels",
                            "bounding_box_3d_labels",
                            "bounding_box_2d_tight",
                            "bounding_box_2d_loose",
                            "bounding_box_3d",
                            "distance_to_camera",
                            "distance_to_image_plane",
                            "pointcloud_normals",
                            "pointcloud_semantic",
                            "pointcloud_instance",
                            "pointcloud_rgb",
                            "pointcloud",
                            "motion_vectors",
                            "camera_params",
                            "occlusion",
                            "normals",
                            "rgb"};

std::string key_of(const std::string& product, const std::string& number, const std::string& kind) {
  return product + "\n" + number + "\n" + kind;
}

}  // namespace

ReplicatorFiles::ReplicatorFiles(const Dataset& dataset) {
  for (const std::string& file : dataset.files()) {
    const std::filesystem::path path(file);
    const std::string name = path.stem().string();
    const std::size_t cut = name.rfind('_');
    if (cut == std::string::npos || cut + 1 == name.size()) continue;
    const std::string number = name.substr(cut + 1);
    if (number.find_first_not_of("0123456789") != std::string::npos) continue;
    const std::string front = name.substr(0, cut);
    const auto stem = std::ranges::find_if(kStems, [&](std::string_view word) {
      return front == word || front.ends_with("_" + std::string(word));
    });
    if (stem == kStems.end()) continue;
    const std::string word = *stem;
    const std::string product = front == word ? path.parent_path().parent_path().generic_string()
                                              : front.substr(0, front.size() - word.size() - 1);
    const std::string kind = word + path.extension().string();
    products_.insert(product);
    numbers_.insert(number);
    kinds_.insert(kind);
    paths_[key_of(product, number, kind)] = file;
  }
}

std::string ReplicatorFiles::path(const std::string& product, const std::string& number,
                                  const std::string& kind) const {
  const auto found = paths_.find(key_of(product, number, kind));
  return found == paths_.end() ? std::string() : found->second;
}

Vec3 ReplicatorCamera::in_camera(const Vec3& world) const {
  return (world.homogeneous().transpose() * view).head<3>().transpose();
}

std::optional<Vec2> ReplicatorCamera::pixel(const Vec3& world) const {
  const Eigen::RowVector4d clip = world.homogeneous().transpose() * view * projection;
  if (clip[3] <= 1e-9) return std::nullopt;
  return Vec2((clip[0] / clip[3] + 1.0) * 0.5 * width, (1.0 - clip[1] / clip[3]) * 0.5 * height);
}

Vec3 ReplicatorCamera::direction(int x, int y) const {
  const double ndc_x = (x + 0.5) / (0.5 * width) - 1.0;
  const double ndc_y = 1.0 - (y + 0.5) / (0.5 * height);
  // clip.x = p00 x + p20 z with z = -w.
  return {(ndc_x + projection(2, 0)) / projection(0, 0),
          (ndc_y + projection(2, 1)) / projection(1, 1), -1.0};
}

ReplicatorCamera camera_of(const Json& camera_params) {
  ReplicatorCamera camera;
  for (int i = 0; i < 16; ++i) {
    const auto k = std::size_t(i);
    camera.view(i / 4, i % 4) = camera_params.at("cameraViewTransform").at(k).get<double>();
    camera.projection(i / 4, i % 4) = camera_params.at("cameraProjection").at(k).get<double>();
  }
  camera.width = camera_params.at("renderProductResolution").at(0).get<int>();
  camera.height = camera_params.at("renderProductResolution").at(1).get<int>();
  camera.is_pinhole = camera_params.at("cameraModel").get<std::string>() == "pinhole";
  return camera;
}

std::optional<Eigen::AlignedBox2d> projected_box(const ReplicatorCamera& camera,
                                                 const Mat4& world_from_local_row,
                                                 const Aabb& box) {
  Eigen::AlignedBox2d result;
  for (int i = 0; i < 8; ++i) {
    const Vec3 world =
        (box.corner(i).homogeneous().transpose() * world_from_local_row).head<3>().transpose();
    const auto pixel = camera.pixel(world);
    if (!pixel) return std::nullopt;
    result.extend(*pixel);
  }
  return result;
}

}  // namespace diorama::lint
