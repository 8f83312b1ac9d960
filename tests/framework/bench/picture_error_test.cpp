// SPDX-License-Identifier: Apache-2.0
#include "framework/bench/picture_error.h"

#include "support/catch.h"

using namespace diorama;
using namespace diorama::bench;

TEST_CASE("equal pictures have no error", "[bench]") {
  const Image<Vec3f> image(9, 5, Vec3f(1.0f, 2.0f, 0.0f));
  const PictureError error = picture_error(image, image);
  CHECK(error.rmse == 0.0);
  CHECK(error.relative_mse == 0.0);
  CHECK(error.bias == 0.0);
}

TEST_CASE("errors of a constant difference follow by hand", "[bench]") {
  const Image<Vec3f> reference(10, 10, Vec3f::Constant(0.5f));
  const Image<Vec3f> image(10, 10, Vec3f::Constant(0.75f));
  const PictureError error = picture_error(image, reference);
  CHECK(error.rmse == Approx(0.25));
  CHECK(error.relative_mse == Approx(0.0625 / (0.25 + 0.01)));
  CHECK(error.trimmed_mse == Approx(error.relative_mse));
  CHECK(error.bias == Approx(0.5));
}

TEST_CASE("one wild pixel in a thousand is trimmed", "[bench]") {
  const Image<Vec3f> reference(100, 20, Vec3f::Ones());
  Image<Vec3f> image = reference;
  image.at(7, 3) = Vec3f::Constant(1001.0f);
  const PictureError error = picture_error(image, reference);
  CHECK(error.trimmed_mse == 0.0);
  CHECK(error.relative_mse == Approx(1e6 / 1.01 / 2000.0));
  CHECK(error.rmse == Approx(1000.0 / std::sqrt(2000.0)));
}
