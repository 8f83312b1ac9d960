// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/object_checks.h"

#include <cmath>

namespace diorama::lint {
namespace {

/// Corners whose numbers differ in bit k differ along axis k. Lenses bend what lies between them.
template <class Visit>
void visit_edges(const Aabb& bounds, int parts, Visit&& visit) {
  for (int a = 0; a < 8; ++a) {
    for (int axis = 0; axis < 3; ++axis) {
      const int b = a | (1 << axis);
      if (b == a) continue;
      for (int i = 0; i <= parts; ++i) {
        const double share = double(i) / parts;
        visit(Vec3((1.0 - share) * bounds.corner(a) + share * bounds.corner(b)));
      }
    }
  }
}

bool is_inside(const Aabb& box, const Vec3& slack, const Vec3& p) {
  return ((p - box.min + slack).array() >= 0.0).all() &&
         ((box.max + slack - p).array() >= 0.0).all();
}

}  // namespace

std::optional<Eigen::AlignedBox2d> projected_extent(const Lens& lens,
                                                    const Affine& camera_from_local,
                                                    const Aabb& bounds) {
  Eigen::AlignedBox2d extent;
  bool is_imaged = true;
  const int parts = lens.model == Lens::Model::Pinhole ? 1 : 24;
  visit_edges(bounds, parts, [&](const Vec3& point) {
    const auto pixel = lens.pixel(camera_from_local * point);
    if (pixel) {
      extent.extend(*pixel);
    } else {
      is_imaged = false;
    }
  });
  if (!is_imaged) return std::nullopt;
  return extent;
}

void check_reprojection(Dataset& dataset, const Lens& lens, const SeenObject& object) {
  const auto extent = projected_extent(lens, object.camera_from_local, object.bounds);
  if (!extent || object.box.is_empty()) return;
  // Pixel centres lie inside.
  const double slack = 0.5 + object.slack_px;
  const PixelBox& b = object.box;
  const bool holds = extent->min().x() <= b.x_min + slack && extent->min().y() <= b.y_min + slack &&
                     extent->max().x() >= b.x_max - slack && extent->max().y() >= b.y_max - slack;
  dataset.check(holds, kReproject, object.file,
                object.who + ": the 3-D box projects to x " + std::to_string(extent->min().x()) +
                    " to " + std::to_string(extent->max().x()) + ", y " +
                    std::to_string(extent->min().y()) + " to " + std::to_string(extent->max().y()) +
                    "; the pixels extend over " + box_text(b));
}

void check_depth(Dataset& dataset, const Lens& lens, const SeenObject& object,
                 const DepthMap& depth) {
  const Affine local_from_camera = object.camera_from_local.inverse();
  // A step of the depth in the local space, whatever the object's scale.
  const double step = depth.slack * local_from_camera.linear().norm();
  const Vec3 slack =
      0.002 * object.bounds.size() + Vec3::Constant(step + 1e-3 * object.bounds.size().norm());
  std::size_t wrong = 0;
  std::size_t all = 0;
  const PixelBox box = object.box.clipped(lens.width, lens.height);
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) {
      if (!object.has(x, y)) continue;
      const double value = depth.value(x, y);
      auto ray = lens.direction(Vec2(x + 0.5, y + 0.5));
      if (!ray || !std::isfinite(value)) continue;
      *ray /= depth.is_along_ray ? ray->norm() : ray->z();
      ++all;
      if (!is_inside(object.bounds, slack, local_from_camera * (*ray * value))) ++wrong;
    }
  }
  dataset.check(wrong == 0, kBackProject, depth.file,
                object.who + ": " + std::to_string(wrong) + " of " + std::to_string(all) +
                    " surface points lie outside its 3-D box");
}

void check_surrounded(Dataset& dataset, const std::string& file, const std::string& who,
                      const Vec2& centre, const Vec2& size, const Eigen::AlignedBox2d& keypoints) {
  const Vec2 slack = Vec2::Ones() + 0.1 * keypoints.sizes();
  const bool holds = ((centre - 0.5 * size - keypoints.min() + slack).array() >= 0.0).all() &&
                     ((keypoints.max() + slack - centre - 0.5 * size).array() >= 0.0).all();
  dataset.check(holds, kReproject, file,
                who + " round " + std::to_string(centre.x()) + ", " + std::to_string(centre.y()) +
                    " is not inside the extent of its keypoints");
}

Mat4 matrix4_of(const Json& rows) {
  Mat4 matrix;
  for (int i = 0; i < 16; ++i) {
    matrix(i / 4, i % 4) = rows.at(std::size_t(i / 4)).at(std::size_t(i % 4)).get<double>();
  }
  return matrix;
}

Vec3 vec3_of(const Json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

Affine flipped_axes() {
  Affine map = Affine::Identity();
  map.linear() = Vec3(1.0, -1.0, -1.0).asDiagonal();
  return map;
}

}  // namespace diorama::lint
