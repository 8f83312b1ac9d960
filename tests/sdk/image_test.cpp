// SPDX-License-Identifier: Apache-2.0
#include "diorama/image.h"

#include "support/catch.h"

using namespace diorama;

TEST_CASE("An image keeps its pixels row by row", "[image]") {
  Image<float> image(3, 2, 0.5f);
  image.at(2, 1) = 7.0f;
  CHECK(image.pixels()[5] == 7.0f);
  CHECK(image.row(1)[2] == 7.0f);
  CHECK(image.row(1).size() == 3);
  CHECK(image.contains(2, 1));
  CHECK_FALSE(image.contains(3, 0));
  CHECK_FALSE(image.contains(0, -1));
}

TEST_CASE("A box is clipped to the image", "[image]") {
  CHECK(PixelBox{-5, 2, 30, 40}.clipped(20, 10) == PixelBox{0, 2, 20, 10});
  CHECK(PixelBox{25, 2, 30, 40}.clipped(20, 10).is_empty());
  CHECK(PixelBox{3, 4, 8, 6}.width() == 5);
}

TEST_CASE("The sRGB curve has its known values and inverts itself", "[image]") {
  CHECK(srgb_from_linear(0.0f) == 0.0f);
  CHECK(srgb_from_linear(1.0f) == Approx(1.0f));
  CHECK(srgb_from_linear(0.18f) == Approx(0.46136f).margin(1e-4));
  CHECK(linear_from_srgb(0.5f) == Approx(0.21404f).margin(1e-4));
  for (int code = 0; code < 256; ++code) {
    const float encoded = float(code) / 255.0f;
    CHECK(srgb_from_linear(linear_from_srgb(encoded)) * 255.0f == Approx(code).margin(1e-3));
  }
}
