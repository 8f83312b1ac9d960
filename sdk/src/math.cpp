// SPDX-License-Identifier: Apache-2.0
#include "diorama/math.h"

#include <Eigen/SVD>

#include "diorama/error.h"

namespace diorama {

Affine Transform::affine() const {
  Affine map = Affine::Identity();
  map.linear() = rotation.normalized().toRotationMatrix() * scale.asDiagonal();
  map.translation() = translation;
  return map;
}

Transform Transform::from_affine(const Affine& map) {
  // A reflection is moved into the x scale first, so that what is left has a rotation in it.
  const double sign = map.linear().determinant() < 0.0 ? -1.0 : 1.0;
  Mat3 linear = map.linear();
  linear.col(0) *= sign;

  const Eigen::JacobiSVD<Mat3> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  const Mat3 v = svd.matrixV();
  // Only a map of rank below 3 can get here with a reflection; its last direction has no length.
  if ((u * v.transpose()).determinant() < 0.0) u.col(2) *= -1.0;
  const Mat3 stretch = v * svd.singularValues().asDiagonal() * v.transpose();

  Transform transform;
  transform.translation = map.translation();
  transform.rotation = Quat(u * v.transpose()).normalized();
  transform.scale = stretch.diagonal();
  transform.scale.x() *= sign;
  return transform;
}

void Aabb::add(const Vec3& point) {
  min = min.cwiseMin(point);
  max = max.cwiseMax(point);
}

void Aabb::add(const Aabb& box) {
  if (box.is_empty()) return;
  add(box.min);
  add(box.max);
}

Aabb Aabb::mapped(const Affine& map) const {
  Aabb box;
  if (is_empty()) return box;
  for (int i = 0; i < 8; ++i) box.add(map * corner(i));
  return box;
}

Vec3 Aabb::corner(int i) const {
  return {(i & 1) ? max.x() : min.x(), (i & 2) ? max.y() : min.y(), (i & 4) ? max.z() : min.z()};
}

namespace {

/// Perpendicular to both and unit length, or zero when they are (nearly) parallel.
Vec3 right_of(const Vec3& forward, const Vec3& up) {
  const Vec3 right = forward.cross(up.normalized());
  return right.norm() < 1e-9 ? Vec3::Zero() : Vec3(right.normalized());
}

}  // namespace

Quat look_rotation(const Vec3& forward, const Vec3& up) {
  if (!forward.allFinite() || forward.norm() == 0.0) {
    throw Error(ErrorKind::Internal,
                "look_rotation: the viewing direction must be a finite vector "
                "other than zero");
  }
  const Vec3 ahead = forward.normalized();
  Vec3 right = right_of(ahead, up);
  if (right.isZero()) right = right_of(ahead, Vec3::UnitY());
  if (right.isZero()) right = right_of(ahead, Vec3::UnitZ());

  Mat3 world_from_camera;
  world_from_camera << right, right.cross(ahead), -ahead;
  return Quat(world_from_camera).normalized();
}

}  // namespace diorama
