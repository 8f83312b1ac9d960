// SPDX-License-Identifier: Apache-2.0
#include "convex_hull.h"

#include <algorithm>
#include "diorama/geometry.h"

#include "diorama/geometry.h"
#include "diorama/rng.h"
#include "mass_properties.h"
#include "support/catch.h"

using namespace diorama;

namespace {

std::vector<Vec3> ellipsoid_points(int count, const Vec3& radii) {
  Rng rng(5);
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i) points.push_back(rng.unit_vector().cwiseProduct(radii));
  return points;
}

}  // namespace

TEST_CASE("the hull of a box with points inside is the box", "[physics]") {
  std::vector<Vec3> points;
  const Aabb box{Vec3(-1, 2, 0.5), Vec3(0.5, 2.25, 3)};
  Rng rng(1);
  for (int i = 0; i < 200; ++i) points.push_back(rng.uniform_in(box));
  for (int i = 0; i < 8; ++i) points.push_back(box.corner(i));
  const ConvexHull hull = convex_hull(points);
  CHECK(hull.points.size() == 8);
  CHECK(hull.triangles.size() == 12);
  CHECK(mass_of_hull(hull).volume == Approx(1.5 * 0.25 * 2.5));
  CHECK(inner_distance(hull, box.centre()) == Approx(0.125));
}

TEST_CASE("a reduced hull keeps to its limit and close to the full one", "[physics]") {
  const std::vector<Vec3> points = ellipsoid_points(3000, Vec3(0.3, 0.1, 0.05));
  const double full = mass_of_hull(convex_hull(points)).volume;
  double last = 0.0;
  for (const std::size_t limit : {16u, 32u, 64u, 128u}) {
    const std::vector<Vec3> reduced = reduced_hull_points(points, limit);
    CHECK(reduced.size() <= limit);
    const double volume = mass_of_hull(convex_hull(reduced)).volume;
    CHECK(volume > last);
    CHECK(volume < full);
    last = volume;
  }
  CHECK(last > 0.93 * full);
  // Extent along the axes is kept exactly: objects touch the ground where they should.
  Aabb all, kept;
  for (const Vec3& point : points) all.add(point);
  for (const Vec3& point : reduced_hull_points(points, 64)) kept.add(point);
  CHECK((all.min - kept.min).norm() == Approx(0.0).margin(1e-12));
  CHECK((all.max - kept.max).norm() == Approx(0.0).margin(1e-12));
}

TEST_CASE("sheets, wires and single points get a body", "[physics]") {
  const std::vector<Vec3> sheet{{0, 0, 1}, {0.2, 0, 1}, {0.2, 0.3, 1}, {0, 0.3, 1}};
  const std::vector<Vec3> wire{{0, 0, 0}, {0.1, 0.2, 0.3}};
  const std::vector<Vec3> point{{1, 2, 3}};
  CHECK(mass_of_hull(convex_hull(thickened(sheet, 1e-3))).volume == Approx(0.06e-3));
  CHECK(mass_of_hull(convex_hull(thickened(wire, 1e-3))).volume ==
        Approx(1e-6 * wire[1].norm()).epsilon(0.01));
  CHECK(mass_of_hull(convex_hull(thickened(point, 1e-3))).volume == Approx(1e-9).epsilon(0.01));
  CHECK(thickened(ellipsoid_points(50, Vec3(1, 2, 3)), 1e-3).size() == 50);
}

TEST_CASE("the reduced hull of a ball stays close to it everywhere", "[physics]") {
  std::vector<Vec3> points;
  for (const Vec3f& position : make_sphere(1.0, 32).positions) {
    points.push_back(position.cast<double>());
  }
  CHECK(inner_distance(convex_hull(points), Vec3::Zero()) > 0.97);
  for (int order = 0; order < 4; ++order) {
    std::rotate(points.begin(), points.begin() + 97, points.end());
    CHECK(inner_distance(convex_hull(reduced_hull_points(points, 64)), Vec3::Zero()) > 0.92);
  }
}
