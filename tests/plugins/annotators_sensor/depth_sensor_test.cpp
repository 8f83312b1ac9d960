// SPDX-License-Identifier: Apache-2.0
#include "depth_sensor.h"

#include <cmath>

#include "sensor_frames.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

constexpr double kBaseline = 0.06;

/// 600 px of focal length.
Camera camera(int width = 320, int height = 240) {
  Camera c;
  c.width = width;
  c.height = height;
  c.fx = c.fy = 600.0;
  c.cx = 0.5 * width;
  c.cy = 0.5 * height;
  return c;
}

/// Nothing that makes holes.
DepthSensor::Params plain_params() {
  DepthSensor::Params params;
  params.baseline_m = kBaseline;
  params.disparity_noise_px = 0.0;
  params.disparity_step_px = 0.0;
  params.min_m = 0.0;
  params.max_m = 1e6;
  params.max_incidence_deg = 90.0;
  params.edge_radius_px = 0;
  params.shadows = false;
  params.dropout = 0.0;
  return params;
}

Image<float> measured(const DepthSensor::Params& params, const Camera& c,
                      const std::function<float(int, int)>& depth) {
  PlainHost host;
  Frame frame = frame_of(c);
  frame.set(kDistanceToImagePlane, image_of<float>(c, depth));
  DepthSensor(params, host).annotate(Scene(), frame);
  return frame.get(kSensorDepth);
}

/// A square of 100 pixels, 1 m away, before a wall 3 m away.
float square_and_wall(int x, int y) {
  return x >= 150 && x < 250 && y >= 70 && y < 170 ? 1.0f : 3.0f;
}

double share_of_zeros(const Image<float>& depth) {
  std::size_t zeros = 0;
  for (const float z : depth.pixels()) zeros += z == 0.0f ? 1 : 0;
  return double(zeros) / double(depth.pixels().size());
}

}  // namespace

TEST_CASE("without faults, depth is the exact one", "[depth_sensor]") {
  const auto depth = measured(plain_params(), camera(), [](int x, int y) {
    return 0.5f + 0.01f * float(x) + 0.003f * float(y);
  });
  for (const auto& [x, y] : {std::pair{0, 0}, {319, 239}, {17, 200}}) {
    CHECK(depth.at(x, y) == Approx(0.5 + 0.01 * x + 0.003 * y).epsilon(1e-6));
  }
  const auto sky = measured(plain_params(), camera(),
                            [](int, int) { return std::numeric_limits<float>::infinity(); });
  CHECK(share_of_zeros(sky) == 1.0);
}

TEST_CASE("depth noise grows with the square of the depth", "[depth_sensor]") {
  DepthSensor::Params params = plain_params();
  params.disparity_noise_px = 0.1;
  for (const double wall : {0.5, 1.0, 3.0}) {
    const auto depth = measured(params, camera(), [&](int, int) { return float(wall); });
    double sum = 0.0, squares = 0.0;
    for (const float z : depth.pixels()) {
      sum += double(z) - wall;
      squares += (double(z) - wall) * (double(z) - wall);
    }
    const double count = double(depth.pixels().size());
    const double deviation = std::sqrt(squares / count);
    CHECK(deviation == Approx(wall * wall / (600.0 * kBaseline) * 0.1).epsilon(0.02));
    CHECK(std::abs(sum / count) < 0.05 * deviation);
  }
}

TEST_CASE("disparities come in steps", "[depth_sensor]") {
  DepthSensor::Params params = plain_params();
  params.disparity_step_px = 0.125;
  const auto depth = measured(params, camera(), [](int x, int) { return 1.0f + 0.01f * float(x); });
  for (const float z : depth.pixels()) {
    const double steps = 600.0 * kBaseline / double(z) / 0.125;
    REQUIRE(std::abs(steps - std::round(steps)) < 1e-4);
  }
}

TEST_CASE("objects shadow what lies to their left, as wide as their disparity says",
          "[depth_sensor]") {
  DepthSensor::Params params = plain_params();
  params.shadows = true;
  const auto depth = measured(params, camera(), square_and_wall);
  // Disparities are 36 and 12 px: 24 px of the wall are hidden from the second view.
  for (int x = 128; x < 149; ++x) CHECK(depth.at(x, 100) == 0.0f);
  for (const int x : {20, 60, 100, 124, 160, 200, 248, 251, 300, 319}) {
    CHECK(depth.at(x, 100) == Approx(square_and_wall(x, 100)).epsilon(1e-6));
  }
  // The second view does not see the left border.
  for (int x = 0; x < 12; ++x) CHECK(depth.at(x, 20) == 0.0f);
  for (int x = 12; x < 320; ++x) CHECK(depth.at(x, 20) == Approx(3.0).epsilon(1e-6));
}

TEST_CASE("a slanted surface shadows nothing of itself", "[depth_sensor]") {
  DepthSensor::Params params = plain_params();
  params.shadows = true;
  // Each pixel to the right is farther: the second view sees the surface stretched.
  const auto depth = measured(
      params, camera(), [](int x, int) { return float(600.0 * kBaseline / (60.0 - 0.15 * x)); });
  for (int x = 60; x < 320; ++x) CHECK(depth.at(x, 50) > 0.0f);
}

TEST_CASE("windows over two surfaces give nothing", "[depth_sensor]") {
  DepthSensor::Params params = plain_params();
  params.edge_radius_px = 3;
  const auto depth = measured(params, camera(), square_and_wall);
  for (int x = 0; x < 320; ++x) {
    const bool is_near_edge = (x >= 147 && x < 153) || (x >= 247 && x < 253);
    CHECK((depth.at(x, 100) == 0.0f) == is_near_edge);
  }
  CHECK(depth.at(148, 68) == 0.0f);  // beside a corner
  CHECK(depth.at(146, 66) > 0.0f);
}

TEST_CASE("grazing surfaces are not measured", "[depth_sensor]") {
  DepthSensor::Params params = plain_params();
  params.max_incidence_deg = 80.0;
  // A floor 1 m below: rays that sink by a meet it at 90 - a from its normal.
  const Camera c = camera(64, 480);
  const auto depth = measured(params, c, [](int, int y) {
    const double down = (y + 0.5 - 240.0) / 600.0;
    return down > 0.0 ? float(1.0 / down) : std::numeric_limits<float>::infinity();
  });
  const int first = int(std::ceil(240.0 + 600.0 * std::tan(10.0 * kPi / 180.0)));
  for (int y = 245; y < first - 2; ++y) CHECK(depth.at(32, y) == 0.0f);
  for (int y = first + 2; y < 480; ++y) CHECK(depth.at(32, y) > 0.0f);
}

TEST_CASE("depth outside the range and dropped pixels are 0", "[depth_sensor]") {
  DepthSensor::Params params = plain_params();
  params.min_m = 1.0;
  params.max_m = 2.0;
  const auto ramp = measured(params, camera(), [](int x, int) { return 0.5f + 0.01f * float(x); });
  for (int x = 0; x < 320; ++x) {
    const bool is_inside = x > 50 && x < 150;
    if (x != 50 && x != 150) CHECK((ramp.at(x, 9) > 0.0f) == is_inside);
  }
  DepthSensor::Params dropping = plain_params();
  dropping.dropout = 0.1;
  const auto wall = measured(dropping, camera(), [](int, int) { return 2.0f; });
  CHECK(share_of_zeros(wall) == Approx(0.1).margin(0.005));
}

TEST_CASE("measurements depend on the seed and not on the order of work", "[depth_sensor]") {
  PlainHost host;
  BackwardHost backward;
  Frame frame = frame_of(camera());
  frame.set(kDistanceToImagePlane, image_of<float>(camera(), square_and_wall));
  DepthSensor({}, host).annotate(Scene(), frame);
  const Image<float> first = frame.get(kSensorDepth);
  DepthSensor({}, backward).annotate(Scene(), frame);
  CHECK(frame.get(kSensorDepth) == first);
  frame.seed = 77;
  DepthSensor({}, host).annotate(Scene(), frame);
  CHECK_FALSE(frame.get(kSensorDepth) == first);
}

TEST_CASE("a range upside down is an error", "[depth_sensor]") {
  PlainHost host;
  DepthSensor::Params params;
  params.min_m = 3.0;
  params.max_m = 2.0;
  CHECK_THROWS_WITH(DepthSensor(params, host), "max_m: must not be less than min_m");
}
