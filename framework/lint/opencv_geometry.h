// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "framework/datasets/lens.h"

namespace diorama::lint {

/// Cameras by OpenCV's formulas. In a library of its own, because the program starts without
/// OpenCV. Several threads may call it.
class OpencvGeometry {
 public:
  /// Pixel coordinates of points in lint's camera axes; nothing for points behind the camera, and
  /// for lenses and angles that OpenCV's models cannot follow to a tenth of a pixel.
  virtual std::vector<std::optional<Vec2>> project(const Lens& lens,
                                                   std::span<const Vec3> points_camera) const = 0;

  /// The rigid camera_from_local by which points are seen at pixels; nothing when no pose fits or
  /// there are fewer than 6 points.
  virtual std::optional<Affine> solve_pose(const Lens& lens, std::span<const Vec3> points_local,
                                           std::span<const Vec2> pixels) const = 0;

 protected:
  ~OpencvGeometry() = default;
};

/// Maps the library at the first call. Throws Error(Plugin) when that does not work.
const OpencvGeometry& opencv_geometry();

}  // namespace diorama::lint
