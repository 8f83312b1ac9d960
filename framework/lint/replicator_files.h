// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>

#include "framework/lint/dataset_files.h"

namespace diorama::lint {

/// The files of one BasicWriter dataset, told apart by their names alone.
class ReplicatorFiles {
 public:
  explicit ReplicatorFiles(const Dataset& dataset);

  /// Render products; "" when the files lie flat.
  const std::set<std::string>& products() const { return products_; }
  const std::set<std::string>& numbers() const { return numbers_; }
  /// Kinds that the dataset holds: "rgb.png", "bounding_box_3d_labels.json".
  const std::set<std::string>& kinds() const { return kinds_; }
  /// Empty when there is none.
  std::string path(const std::string& product, const std::string& number,
                   const std::string& kind) const;

 private:
  std::set<std::string> products_;
  std::set<std::string> numbers_;
  std::set<std::string> kinds_;
  std::map<std::string, std::string> paths_;
};

/// A camera as camera_params_NNNN.json and PoseWriter files describe it.
struct ReplicatorCamera {
  Mat4 view = Mat4::Identity();  ///< Row vectors.
  Mat4 projection = Mat4::Identity();
  int width = 0;
  int height = 0;
  bool is_pinhole = true;  ///< Else the matrices do not tell the pixel.

  Vec3 in_camera(const Vec3& world) const;
  /// Nothing for points behind the camera.
  std::optional<Vec2> pixel(const Vec3& world) const;
  /// Camera-space direction of a pixel centre with z = -1.
  Vec3 direction(int x, int y) const;
};

/// Throws when keys are missing.
ReplicatorCamera camera_of(const Json& camera_params);

/// Box of the projected corners; nothing when one of them lies behind the camera.
std::optional<Eigen::AlignedBox2d> projected_box(const ReplicatorCamera& camera,
                                                 const Mat4& world_from_local_row, const Aabb& box);

}  // namespace diorama::lint
