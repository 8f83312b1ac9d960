// SPDX-License-Identifier: Apache-2.0
#include "mass_properties.h"

#include "diorama/geometry.h"
#include "support/catch.h"

using namespace diorama;

namespace {

MassProperties mass_of_mesh(const Mesh& mesh) {
  std::vector<Vec3> points;
  for (const Vec3f& position : mesh.positions) points.push_back(position.cast<double>());
  return mass_of_hull(convex_hull(points));
}

/// The exact solid against its fine tessellation, an independent way to the same numbers.
void check_against_mesh(const MassProperties& exact, const Mesh& mesh) {
  const MassProperties meshed = mass_of_mesh(mesh);
  CHECK(meshed.volume == Approx(exact.volume).epsilon(5e-3));
  CHECK((meshed.centroid - exact.centroid).norm() < 2e-3);
  CHECK((meshed.second_moment - exact.second_moment).norm() < 8e-3 * exact.second_moment.norm());
}

}  // namespace

TEST_CASE("closed forms of the primitives agree with their tessellations", "[physics]") {
  constexpr int kFine = 160;
  check_against_mesh(mass_of_box(Vec3(0.3, 0.5, 0.7)), make_box(Vec3(0.3, 0.5, 0.7)));
  check_against_mesh(mass_of_sphere(0.4), make_sphere(0.4, kFine));
  check_against_mesh(mass_of_cylinder(0.3, 0.9), make_cylinder(0.3, 0.9, kFine));
  check_against_mesh(mass_of_cone(0.3, 0.9), make_cone(0.3, 0.9, kFine));
  check_against_mesh(mass_of_capsule(0.3, 0.9), make_capsule(0.3, 0.9, kFine));
}

TEST_CASE("two halves of a box weigh and turn like the box", "[physics]") {
  const Vec3 half(0.2, 0.5, 0.3);
  const Rigid place =
      to_rigid(Mat3(Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized())), Vec3(3, -2, 1));
  const auto moved = [&](double x) {
    return mapped(mass_of_box(half), place * Rigid(Eigen::Translation3d(x, 0, 0)));
  };
  const MassProperties both = combined(moved(-0.1), moved(0.1));
  const MassProperties whole = mapped(mass_of_box(Vec3(0.4, 0.5, 0.3)), place);
  CHECK(both.volume == Approx(whole.volume));
  CHECK((both.centroid - whole.centroid).norm() < 1e-12);
  CHECK((both.inertia(7.0) - whole.inertia(7.0)).norm() < 1e-12);
  // m / 12 (b^2 + c^2), the textbook's box.
  const Mat3 local = mass_of_box(Vec3(0.4, 0.5, 0.3)).inertia(7.0);
  CHECK(local(0, 0) == Approx(7.0 / 12.0 * (0.25 + 0.09)));
  CHECK(local(1, 1) == Approx(7.0 / 12.0 * (0.16 + 0.09)));
  CHECK(local(2, 2) == Approx(7.0 / 12.0 * (0.16 + 0.25)));
}
