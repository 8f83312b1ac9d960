// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/polygon.h"

#include <vector>

#include "support/catch.h"

namespace diorama::loader_usd {
namespace {

double area(const std::vector<Vec3f>& corners,
            const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  double sum = 0.0;
  for (const auto& [a, b, c] : triangles) {
    const Vec3f normal = (corners[b] - corners[a]).cross(corners[c] - corners[a]);
    sum += 0.5 * normal.z();
  }
  return sum;
}

}  // namespace

TEST_CASE("a concave polygon is split inside of its outline", "[polygon]") {
  // An L of area 5, counter-clockwise, whose notch a fan would cover.
  const std::vector<Vec3f> corners = {{3, 1, 0}, {1, 1, 0}, {1, 3, 0},
                                      {0, 3, 0}, {0, 0, 0}, {3, 0, 0}};
  std::vector<std::array<std::uint32_t, 3>> triangles;
  triangulate(corners, triangles);
  REQUIRE(triangles.size() == 4);
  CHECK(area(corners, triangles) == Approx(5.0));
  for (const auto& triangle : triangles) CHECK(area(corners, {triangle}) > 0.0);
}

TEST_CASE("degenerate polygons still give n - 2 triangles", "[polygon]") {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  triangulate(std::vector<Vec3f>(7, Vec3f(1, 2, 3)), triangles);
  CHECK(triangles.size() == 5);
  triangles.clear();
  // A bow tie crosses itself.
  triangulate(std::vector<Vec3f>{{0, 0, 0}, {2, 2, 0}, {2, 0, 0}, {0, 3, 0}, {-1, 1, 0}},
              triangles);
  CHECK(triangles.size() == 3);
  triangles.clear();
  triangulate(std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}}, triangles);
  CHECK(triangles.empty());
}

}  // namespace diorama::loader_usd
