// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/replicator_files.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <tuple>

#include "framework/lint/object_checks.h"

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
                            "sensor_depth",
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

bool NumberLess::operator()(const std::string& a, const std::string& b) const {
  const auto value = [](std::string_view digits) {
    return digits.substr(std::min(digits.find_first_not_of('0'), digits.size()));
  };
  const auto key = [&](const std::string& digits) {
    return std::tuple(value(digits).size(), value(digits), digits.size());
  };
  return key(a) < key(b);
}

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

namespace {

/// Sixteen numbers for row vectors, as a matrix for column vectors.
Mat4 column_matrix(const Json& list) {
  Mat4 matrix;
  for (int i = 0; i < 16; ++i) matrix(i % 4, i / 4) = list.at(std::size_t(i)).get<double>();
  return matrix;
}

void read_distortion(const Json& params, Lens& lens) {
  const std::string model = params.at("cameraModel").get<std::string>();
  const auto polynomial = params.at("cameraFisheyePolynomial").get<std::vector<double>>();
  if (model == "pinholeOpenCV") {
    const auto tangential = params.at("cameraFisheyeLensP").get<std::vector<double>>();
    lens.model = Lens::Model::Opencv;
    lens.distortion = {polynomial.at(0), polynomial.at(1), tangential.at(0), tangential.at(1),
                       polynomial.at(2), polynomial.at(3), polynomial.at(4), polynomial.at(5)};
  } else if (model == "fisheyePolynomial") {
    lens.model = Lens::Model::Fisheye;
    std::copy_n(polynomial.begin(), std::min(polynomial.size(), lens.polynomial.size()),
                lens.polynomial.begin());
    lens.max_angle = params.at("cameraFisheyeMaxFOV").get<double>() * kPi / 360.0;
  } else if (model != "pinhole") {
    throw std::runtime_error("unknown cameraModel '" + model + "'");
  }
}

}  // namespace

ReplicatorCamera camera_of(const Json& params) {
  ReplicatorCamera camera;
  Affine camera_from_world;
  camera_from_world.matrix() = column_matrix(params.at("cameraViewTransform"));
  camera.camera_from_world = flipped_axes() * camera_from_world;
  const Mat4 clip_from_camera = column_matrix(params.at("cameraProjection"));
  Lens& lens = camera.lens;
  lens.width = params.at("renderProductResolution").at(0).get<int>();
  lens.height = params.at("renderProductResolution").at(1).get<int>();
  const Vec2 half(0.5 * lens.width, 0.5 * lens.height);
  lens.focal = {half.x() * clip_from_camera(0, 0), half.y() * clip_from_camera(1, 1)};
  lens.centre = {half.x() * (1.0 - clip_from_camera(0, 2)),
                 half.y() * (1.0 + clip_from_camera(1, 2))};
  read_distortion(params, lens);
  return camera;
}

}  // namespace diorama::lint
