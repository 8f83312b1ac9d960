// SPDX-License-Identifier: Apache-2.0
#include "diorama/camera.h"

#include "diorama/rng.h"
#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

Camera lopsided_pinhole() {
  Camera camera;
  camera.width = 640;
  camera.height = 360;
  camera.fx = 500.0;
  camera.fy = 450.0;
  camera.cx = 301.5;
  camera.cy = 190.25;
  return camera;
}

Camera distorted() {
  Camera camera = lopsided_pinhole();
  camera.lens = LensModel::OpencvPinhole;
  camera.distortion = {0.12, -0.08, 0.004, -0.003, 0.02, 0.05, -0.02, 0.003};
  return camera;
}

Camera barrel(double k1) {
  Camera camera = lopsided_pinhole();
  camera.lens = LensModel::OpencvPinhole;
  camera.distortion = {k1};
  return camera;
}

Camera fisheye() {
  Camera camera = lopsided_pinhole();
  camera.lens = LensModel::FisheyePolynomial;
  camera.fisheye_polynomial = {0.0, 0.0042, 1e-7, 2e-9, -3e-12, 1e-15};
  camera.fisheye_max_angle_rad = 1.7;
  return camera;
}

/// A pixel's ray, followed for `distance` and projected, comes back to the pixel.
void check_round_trip(const Camera& camera, double tolerance) {
  Rng rng(5);
  int imaged = 0;
  for (int i = 0; i < 500; ++i) {
    const Vec2 pixel(rng.uniform(0, camera.width), rng.uniform(0, camera.height));
    const auto direction = ray_direction(camera, pixel);
    if (!direction) continue;
    ++imaged;
    REQUIRE(direction->norm() == Approx(1.0).epsilon(1e-12));
    const auto again = project(camera, rng.uniform(0.1, 50.0) * *direction);
    REQUIRE(again);
    REQUIRE((*again - pixel).norm() < tolerance);
  }
  CHECK(imaged == 500);
}

}  // namespace

TEST_CASE("Pixels and rays are inverse to each other for every lens", "[camera]") {
  check_round_trip(lopsided_pinhole(), 1e-9);
  check_round_trip(distorted(), 1e-8);
  check_round_trip(barrel(-0.2), 1e-8);
  check_round_trip(fisheye(), 1e-8);
}

TEST_CASE("A camera from a lens has the focal length in pixels of its sensor", "[camera]") {
  const Camera camera = Camera::from_lens(512, 300, 24.0, 20.954999923706055);
  CHECK(camera.fx == Approx(586.3994292).epsilon(1e-9));
  CHECK(camera.fy == camera.fx);
  CHECK(camera.cx == 256.0);
  CHECK(camera.cy == 150.0);
  CHECK(test::error_text([] { Camera::from_lens(512, 0, 24, 20); }) ==
        "camera: width, height, focal length and aperture must be greater than 0");
}

TEST_CASE("A pinhole projects by similar triangles, up being up", "[camera]") {
  const auto pixel = project(lopsided_pinhole(), Vec3(1.0, 2.0, -4.0));
  REQUIRE(pixel);
  CHECK(pixel->x() == Approx(301.5 + 500.0 * 0.25));
  CHECK(pixel->y() == Approx(190.25 - 450.0 * 0.5));
  CHECK_FALSE(project(lopsided_pinhole(), Vec3(1, 1, 0)));
  CHECK_FALSE(project(lopsided_pinhole(), Vec3(0, 0, 1)));
}

TEST_CASE("OpenCV distortion follows its formula term by term", "[camera]") {
  // Point (x, y) = (0.5, -0.25) in OpenCV's frame (y down), r2 = 0.3125; one coefficient at a time.
  const Vec3 point(1.0, 0.5, -2.0);
  const double x = 0.5, y = -0.25, r2 = 0.3125;
  const auto with = [&](std::size_t index, double value) {
    Camera camera = lopsided_pinhole();
    camera.lens = LensModel::OpencvPinhole;
    camera.distortion[index] = value;
    const Vec2 pixel = *project(camera, point);
    return Vec2((pixel.x() - 301.5) / 500.0, (pixel.y() - 190.25) / 450.0);
  };
  const Vec2 p(x, y);
  CHECK(with(0, 0.1).isApprox(p * (1 + 0.1 * r2), 1e-12));
  CHECK(with(1, 0.1).isApprox(p * (1 + 0.1 * r2 * r2), 1e-12));
  CHECK(with(2, 0.1).isApprox(p + Vec2(0.2 * x * y, 0.1 * (r2 + 2 * y * y)), 1e-12));
  CHECK(with(3, 0.1).isApprox(p + Vec2(0.1 * (r2 + 2 * x * x), 0.2 * x * y), 1e-12));
  CHECK(with(4, 0.1).isApprox(p * (1 + 0.1 * r2 * r2 * r2), 1e-12));
  CHECK(with(5, 0.1).isApprox(p / (1 + 0.1 * r2), 1e-12));
  CHECK(with(6, 0.1).isApprox(p / (1 + 0.1 * r2 * r2), 1e-12));
  CHECK(with(7, 0.1).isApprox(p / (1 + 0.1 * r2 * r2 * r2), 1e-12));
}

TEST_CASE("What barrel distortion folds back into the image is not imaged", "[camera]") {
  const Camera strong = barrel(-0.3);
  // r (1 - 0.3 r^2) turns around at r = 1 / sqrt(0.9) = 1.054 and comes back to 0 at 1.826.
  CHECK(project(strong, Vec3(1.0, 0, -1)));
  CHECK_FALSE(project(strong, Vec3(1.1, 0, -1)));
  CHECK_FALSE(project(strong, Vec3(1.826, 0, -1)));
  CHECK_FALSE(project(strong, Vec3(30.0, 0, -1)));
  // The largest imaged radius is 0.7027, 351 pixels to the right of the centre.
  CHECK(ray_direction(strong, Vec2(301.5 + 351.0, 190.25)));
  CHECK_FALSE(ray_direction(strong, Vec2(301.5 + 352.0, 190.25)));
}

TEST_CASE("A fisheye with a linear polynomial is equidistant and sees behind itself", "[camera]") {
  Camera camera = lopsided_pinhole();
  camera.lens = LensModel::FisheyePolynomial;
  camera.fisheye_polynomial = {0.0, 0.01, 0, 0, 0, 0};
  camera.fisheye_max_angle_rad = 2.0;
  const auto side = project(camera, Vec3(3.0, 0.0, 0.0));
  REQUIRE(side);
  CHECK(side->x() == Approx(301.5 + 100.0 * kPi / 2));
  CHECK(side->y() == Approx(190.25));
  const auto up = project(camera, Vec3(0.0, 1.0, -1.0));
  REQUIRE(up);
  CHECK(up->x() == Approx(301.5));
  CHECK(up->y() == Approx(190.25 - 100.0 * kPi / 4));
  CHECK(project(camera, Vec3(0, 0, -1))->isApprox(Vec2(301.5, 190.25)));
  CHECK(project(camera, Vec3(0, 1, 0.4)));
  CHECK_FALSE(project(camera, Vec3(0, 1, 0.5)));  // 2.03 rad off the axis
  CHECK_FALSE(ray_direction(camera, Vec2(301.5 + 201.0, 190.25)));
}

TEST_CASE("A fisheye without a polynomial images nothing", "[camera]") {
  Camera camera = lopsided_pinhole();
  camera.lens = LensModel::FisheyePolynomial;
  CHECK_FALSE(project(camera, Vec3(1, 0, -1)));
  CHECK_FALSE(ray_direction(camera, Vec2(100, 100)));
}
