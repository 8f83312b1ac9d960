// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/contours.h"

#include <algorithm>
#include <string>
#include <vector>

#include "opencv_support/mask_parts.h"
#include "support/catch.h"

using namespace diorama;

namespace {

Image<std::uint32_t> image_of(const std::vector<std::string>& rows) {
  Image<std::uint32_t> image(int(rows[0].size()), int(rows.size()), 0);
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      image.at(x, y) = rows[std::size_t(y)][std::size_t(x)] == '#' ? 7 : 0;
    }
  }
  return image;
}

/// Even-odd rule at pixel centres.
bool is_inside(const Polygon& polygon, const Vec2& p) {
  bool inside = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Vec2& a = polygon[i];
    const Vec2& b = polygon[j];
    if ((a.y() > p.y()) == (b.y() > p.y())) continue;
    if (p.x() < (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()) + a.x()) inside = !inside;
  }
  return inside;
}

/// How often a polygon goes round a point, clockwise on the screen.
int winding(const Polygon& polygon, const Vec2& p) {
  int turns = 0;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Vec2& a = polygon[j];
    const Vec2& b = polygon[i];
    if ((a.y() > p.y()) == (b.y() > p.y())) continue;
    if (p.x() < (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()) + a.x()) {
      turns += b.y() > a.y() ? 1 : -1;
    }
  }
  return turns;
}

/// Positive for clockwise on the screen.
double signed_area(const Polygon& polygon) {
  double area = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2& a = polygon[i];
    const Vec2& b = polygon[(i + 1) % polygon.size()];
    area += 0.5 * (a.x() * b.y() - b.x() * a.y());
  }
  return area;
}

}  // namespace

TEST_CASE("outlines run along pixel edges, clockwise, one per part", "[writers]") {
  const auto image = image_of({".....", ".##.#", ".#..#", ".###."});
  const auto parts = outlines(image, 7, {1, 1, 5, 4});
  REQUIRE(parts.size() == 2);
  CHECK(parts[0].outer == Polygon{{1, 1}, {3, 1}, {3, 2}, {2, 2}, {2, 3}, {4, 3}, {4, 4}, {1, 4}});
  CHECK(parts[1].outer == Polygon{{4, 1}, {5, 1}, {5, 3}, {4, 3}});
  const Polygon all = joined(parts);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 5; ++x) {
      CHECK(is_inside(all, {x + 0.5, y + 0.5}) == (image.at(x, y) == 7));
    }
  }
}

TEST_CASE("polygons leave out holes, and what lies in them is a part of its own", "[writers]") {
  const auto image = image_of({"........", ".######.", ".#....#.", ".#.##.#.", ".#.#.##.",  //
                               ".#..#.#.", ".######.", ".#.#.##.", ".######."});
  const auto parts = outlines(image, 7, {0, 0, 8, 9});
  REQUIRE(parts.size() == 2);
  CHECK(parts[0].outer.size() == 4);
  // Holes that touch at a corner are two.
  CHECK(parts[0].holes.size() == 4);
  const auto agrees = [&](const Polygon& polygon) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) {
        CAPTURE(x, y);
        CHECK(is_inside(polygon, {x + 0.5, y + 0.5}) == (image.at(x, y) == 7));
        CHECK(winding(polygon, {x + 0.5, y + 0.5}) == (image.at(x, y) == 7 ? 1 : 0));
      }
    }
  };
  agrees(joined(parts));
}

TEST_CASE("polygons of noise hold exactly its pixels", "[writers]") {
  // Every kind of contact.
  std::uint32_t random = 3;
  for (const int size : {1, 2, 5, 23, 40}) {
    Image<std::uint32_t> noise(size + 6, size, 0);
    for (std::uint32_t& pixel : noise.pixels()) {
      random = random * 1664525u + 1013904223u;
      pixel = (random >> 16) % 5 < 3 ? 7 : 0;
    }
    const auto parts = outlines(noise, 7, {0, 0, noise.width(), noise.height()});
    double area = 0.0;
    for (const Outline& part : parts) {
      area += signed_area(part.outer);
      CHECK(signed_area(part.outer) > 0.0);
      for (const Polygon& hole : part.holes) {
        CHECK(signed_area(hole) < 0.0);
        area += signed_area(hole);
      }
    }
    CHECK(area == double(std::ranges::count(noise.pixels(), 7u)));
    if (parts.empty()) continue;
    const Polygon all = joined(parts);
    for (int y = 0; y < noise.height(); ++y) {
      for (int x = 0; x < noise.width(); ++x) {
        CHECK(is_inside(all, {x + 0.5, y + 0.5}) == (noise.at(x, y) == 7));
        CHECK(winding(all, {x + 0.5, y + 0.5}) == (noise.at(x, y) == 7 ? 1 : 0));
      }
    }
  }
}

TEST_CASE("only what lies in the box counts, and no part is no outline", "[writers]") {
  const auto image = image_of({"#####", "#####", "#####"});
  const auto parts = outlines(image, 7, {1, 1, 4, 3});
  REQUIRE(parts.size() == 1);
  CHECK(parts[0].outer == Polygon{{1, 1}, {4, 1}, {4, 3}, {1, 3}});
  CHECK(outlines(image, 8, {0, 0, 5, 3}).empty());
  CHECK(outlines(image, 7, {2, 2, 2, 2}).empty());
}

TEST_CASE("the least rectangle of a slanted strip is slanted", "[writers]") {
  const auto image = image_of({"#....", "##...", ".##..", "..##.", "...##"});
  const auto corners = least_rectangle(outlines(image, 7, {0, 0, 5, 5}));
  const double a = (corners[1] - corners[0]).norm();
  const double b = (corners[2] - corners[1]).norm();
  CHECK((corners[1] - corners[0]).dot(corners[2] - corners[1]) == Approx(0.0).margin(1e-9));
  CHECK(a * b < 25.0 - 5.0);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 5; ++x) {
      if (image.at(x, y) != 7) continue;
      CHECK(is_inside({corners.begin(), corners.end()}, {x + 0.5, y + 0.5}));
    }
  }
}

TEST_CASE("no rectangle is smaller than the least one", "[writers]") {
  std::uint32_t random = 11;
  for (int run = 0; run < 40; ++run) {
    Image<std::uint32_t> image(60, 50, 0);
    for (int i = 0; i < 12; ++i) {
      random = random * 1664525u + 1013904223u;
      image.at(int(random >> 8) % 60 & 63, int(random >> 20) % 50) = 7;
    }
    const auto parts = outlines(image, 7, {0, 0, 60, 50});
    const auto corners = least_rectangle(parts);
    const double area = (corners[1] - corners[0]).norm() * (corners[2] - corners[1]).norm();
    double least = 1e9;
    for (int step = 0; step < 3600; ++step) {
      const double angle = kPi / 2.0 * step / 3600.0;
      Eigen::AlignedBox2d extent;
      for (const Outline& part : parts) {
        for (const Vec2& p : part.outer) extent.extend(Vec2(Eigen::Rotation2Dd(angle) * p));
      }
      least = std::min(least, extent.volume());
    }
    CHECK(area <= least * 1.0001);
    CHECK(area >= least * 0.995);
  }
}

TEST_CASE("parts are connected by edges and counted", "[writers]") {
  const std::vector<std::uint8_t> bits{1, 0, 1, 1,  //
                                       0, 1, 0, 1,  //
                                       9, 0, 0, 1};
  const MaskParts parts = connected_parts(bits, 4, 3);
  CHECK(parts.part == std::vector<std::int32_t>{1, 0, 2, 2, 0, 3, 0, 2, 4, 0, 0, 2});
  CHECK(parts.sizes == std::vector<std::int64_t>{1, 4, 1, 1});
  REQUIRE(parts.boxes.size() == 4);
  CHECK(parts.boxes[1] == PixelBox{2, 0, 4, 3});
  CHECK(connected_parts({}, 0, 0).part.empty());
}
