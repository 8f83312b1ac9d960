// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/color_maps.h"

#include <cmath>
#include <limits>

#include "support/catch.h"

using namespace diorama;

TEST_CASE("near is red, far is blue, steps are of equal ratio", "[writers]") {
  const float none = std::numeric_limits<float>::infinity();
  Image<float> distances(5, 1, none);
  distances.pixels()[0] = 0.5f;
  distances.pixels()[1] = 1.0f;
  distances.pixels()[2] = 2.0f;
  const Image<Rgba8> colors = distance_colors(distances, {0.5f, 2.0f});
  const auto& near = colors.pixels()[0];
  const auto& middle = colors.pixels()[1];
  const auto& far = colors.pixels()[2];
  CHECK(near[0] > 2 * near[2]);
  CHECK(far[2] > 2 * far[1]);
  CHECK(middle[1] > 200);
  CHECK(colors.pixels()[3] == Rgba8{});
  // What lies beyond the range has the colour of its end.
  distances.pixels()[3] = 100.0f;
  CHECK(distance_colors(distances, {0.5f, 2.0f}).pixels()[3] == far);
  // A flat wall has one colour, nothing has none.
  CHECK(distance_colors(distances, {1.0f, 1.0f}).pixels()[1][3] == 255);
  CHECK(distance_colors(Image<float>(1, 1, none), distance_range(Image<float>(1, 1, none)))
            .pixels()[0] == Rgba8{});
}

TEST_CASE("ranges leave single pixels out", "[writers]") {
  Image<float> distances(100, 10, 1.0f);
  for (std::size_t i = 0; i < 500; ++i) distances.pixels()[i] = 3.0f;
  distances.pixels()[7] = 1000.0f;
  distances.pixels()[8] = -1.0f;
  distances.pixels()[9] = std::nanf("");
  const DistanceRange range = distance_range(distances);
  CHECK(range.near == 1.0f);
  CHECK(range.far == 3.0f);
  Image<Vec2f> motion(100, 10, Vec2f::Zero());
  CHECK(motion_range(motion) == 0.0f);
  for (std::size_t i = 0; i < 500; ++i) motion.pixels()[i] = Vec2f(3.0f, 4.0f);
  CHECK(motion_range(motion) == 5.0f);
}

TEST_CASE("motion has its direction as hue and its length as saturation", "[writers]") {
  Image<Vec2f> motion(6, 1, Vec2f::Zero());
  motion.pixels()[1] = Vec2f(2.0f, 0.0f);
  motion.pixels()[2] = Vec2f(-2.0f, 0.0f);
  motion.pixels()[3] = Vec2f(1.0f, 0.0f);
  motion.pixels()[4] = Vec2f(9.0f, 0.0f);
  motion.pixels()[5] = Vec2f(std::nanf(""), 0.0f);
  const Image<Rgba8> colors = motion_colors(motion, 2.0f);
  CHECK(colors.pixels()[0] == Rgba8{255, 255, 255, 255});
  CHECK(colors.pixels()[1] == Rgba8{255, 0, 0, 255});
  CHECK(colors.pixels()[2][0] == 0);  // cyan
  CHECK(colors.pixels()[2][1] > 240);
  CHECK(colors.pixels()[2][2] > 240);
  CHECK(colors.pixels()[3] == Rgba8{255, 128, 128, 255});
  CHECK(colors.pixels()[4] == colors.pixels()[1]);
  CHECK(colors.pixels()[5] == colors.pixels()[0]);
}
