// SPDX-License-Identifier: Apache-2.0
#include "hull_shape.h"

#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"

using namespace diorama;

namespace {

void check_is_bullets(const std::vector<btVector3>& points, Rng& rng) {
  constexpr double kMargin = 0.004;
  const HullShape shape(points, kMargin);
  btConvexHullShape bullets;
  bullets.setMargin(kMargin);
  for (const btVector3& point : points) bullets.addPoint(point);
  std::vector<btVector3> directions{{1, 0, 0}, {0, -1, 0}, {0, 0, 1},
                                    {1, 1, 0}, {-1, 0, 1}, {0, 0, 0}};
  for (int i = 0; i < 200; ++i) {
    directions.emplace_back(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
  }
  const auto are_same = [](const btVector3& a, const btVector3& b) {
    return a.x() == b.x() && a.y() == b.y() && a.z() == b.z();
  };
  int unequal = 0;
  for (const btVector3& direction : directions) {
    // As Bullet asks: with and without a virtual call, with and without the margin.
    unequal += int(!are_same(shape.localGetSupportingVertexWithoutMargin(direction),
                             bullets.localGetSupportingVertexWithoutMargin(direction)));
    unequal += int(!are_same(shape.localGetSupportVertexWithoutMarginNonVirtual(direction),
                             bullets.localGetSupportVertexWithoutMarginNonVirtual(direction)));
    unequal += int(!are_same(shape.localGetSupportVertexNonVirtual(direction),
                             bullets.localGetSupportVertexNonVirtual(direction)));
  }
  CHECK(unequal == 0);
  btTransform pose(btQuaternion(btVector3(1, 2, 3).normalized(), 0.7), btVector3(1, -2, 0.5));
  btVector3 low, high, bullets_low, bullets_high;
  shape.getAabb(pose, low, high);
  bullets.getAabb(pose, bullets_low, bullets_high);
  CHECK(are_same(low, bullets_low));
  CHECK(are_same(high, bullets_high));
  CHECK(shape.isPolyhedral());
  CHECK(shape.getMarginNonVirtual() == kMargin);
}

}  // namespace

TEST_CASE("A hull's farthest corners are those that Bullet finds", "[hull]") {
  Rng rng(5);
  for (const int count : {1, 2, 3, 7, 8, 9, 16, 33, 64, 100}) {
    CAPTURE(count);
    std::vector<btVector3> points;
    for (int i = 0; i < count; ++i) {
      points.emplace_back(rng.uniform(-1, 1), rng.uniform(-2, 2), rng.uniform(-0.1, 0.1));
    }
    check_is_bullets(points, rng);
  }
}

TEST_CASE("Of corners that are equally far a hull takes the first, as Bullet does", "[hull]") {
  Rng rng(6);
  std::vector<btVector3> grid;
  for (int i = 0; i < 27; ++i) grid.emplace_back(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
  check_is_bullets(grid, rng);
  check_is_bullets(std::vector<btVector3>(12, btVector3(0.5, -0.25, 2.0)), rng);
}
