// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/object_checks.h"

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

Affine flipped_axes() {
  Affine map = Affine::Identity();
  map.linear() = Vec3(1.0, -1.0, -1.0).asDiagonal();
  return map;
}

}  // namespace diorama::lint
