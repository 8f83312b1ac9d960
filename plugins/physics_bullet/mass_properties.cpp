// SPDX-License-Identifier: Apache-2.0
#include "mass_properties.h"

namespace diorama {
namespace {

Mat3 diagonal(double x, double y, double z) { return Vec3(x, y, z).asDiagonal(); }

}  // namespace

Mat3 MassProperties::inertia(double mass_kg) const {
  const Mat3 moment = second_moment * (mass_kg / volume);
  return Mat3::Identity() * moment.trace() - moment;
}

// Sums of the tetrahedra between an inner point and each face; the second moment of the tetrahedron
// (0, a, b, c) is det / 120 * (s s^T + a a^T + b b^T + c c^T) with s = a + b + c.
MassProperties mass_of_hull(const ConvexHull& hull) {
  MassProperties solid;
  if (hull.points.empty()) return solid;
  Vec3 origin = Vec3::Zero();
  for (const Vec3& point : hull.points) origin += point / double(hull.points.size());
  Vec3 first_moment = Vec3::Zero();
  Mat3 moment = Mat3::Zero();
  for (const auto& triangle : hull.triangles) {
    const Vec3 a = hull.points[triangle[0]] - origin;
    const Vec3 b = hull.points[triangle[1]] - origin;
    const Vec3 c = hull.points[triangle[2]] - origin;
    const Vec3 sum = a + b + c;
    const double det = a.dot(b.cross(c));
    solid.volume += det / 6.0;
    first_moment += det / 24.0 * sum;
    moment += det / 120.0 *
              (sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  if (!(solid.volume > 0.0)) return MassProperties{};
  const Vec3 centroid = first_moment / solid.volume;
  solid.centroid = origin + centroid;
  solid.second_moment = moment - solid.volume * centroid * centroid.transpose();
  return solid;
}

MassProperties mass_of_box(const Vec3& size) {
  MassProperties solid;
  solid.volume = size.prod();
  solid.second_moment = (solid.volume / 12.0) * Mat3(size.cwiseAbs2().asDiagonal());
  return solid;
}

MassProperties mass_of_sphere(double radius) {
  MassProperties solid;
  solid.volume = 4.0 / 3.0 * kPi * radius * radius * radius;
  solid.second_moment = Mat3::Identity() * (solid.volume * radius * radius / 5.0);
  return solid;
}

MassProperties mass_of_cylinder(double radius, double height) {
  MassProperties solid;
  solid.volume = kPi * radius * radius * height;
  const double across = radius * radius / 4.0;
  solid.second_moment = solid.volume * diagonal(across, across, height * height / 12.0);
  return solid;
}

MassProperties mass_of_cone(double radius, double height) {
  MassProperties solid;
  solid.volume = kPi * radius * radius * height / 3.0;
  solid.centroid = Vec3(0.0, 0.0, -height / 4.0);
  const double across = 3.0 / 20.0 * radius * radius;
  solid.second_moment = solid.volume * diagonal(across, across, 3.0 / 80.0 * height * height);
  return solid;
}

MassProperties mass_of_capsule(double radius, double height) {
  const MassProperties tube = mass_of_cylinder(radius, height);
  const MassProperties caps = mass_of_sphere(radius);
  MassProperties solid;
  solid.volume = tube.volume + caps.volume;
  const double shift = height * height / 4.0 + 3.0 * height * radius / 8.0;
  solid.second_moment = tube.second_moment + caps.second_moment;
  solid.second_moment(2, 2) += caps.volume * shift;
  return solid;
}

MassProperties mapped(const MassProperties& solid, const Rigid& b_from_a) {
  const Mat3 rotation = b_from_a.linear();
  return {solid.volume, b_from_a * solid.centroid,
          rotation * solid.second_moment * rotation.transpose()};
}

MassProperties combined(const MassProperties& a, const MassProperties& b) {
  MassProperties solid;
  solid.volume = a.volume + b.volume;
  if (!(solid.volume > 0.0)) return solid;
  solid.centroid = (a.volume * a.centroid + b.volume * b.centroid) / solid.volume;
  const Vec3 to_a = a.centroid - solid.centroid;
  const Vec3 to_b = b.centroid - solid.centroid;
  solid.second_moment = a.second_moment + a.volume * to_a * to_a.transpose() + b.second_moment +
                        b.volume * to_b * to_b.transpose();
  return solid;
}

}  // namespace diorama
