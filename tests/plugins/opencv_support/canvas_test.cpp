// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/canvas.h"

#include <cmath>
#include <string>

#include "support/catch.h"

using namespace diorama;

namespace {

constexpr Rgba8 kInk{255, 0, 0, 255};

/// '#' where something was drawn, rows joined by '/'.
std::string drawn(const Image<Rgba8>& picture) {
  std::string text;
  for (int y = 0; y < picture.height(); ++y) {
    if (y > 0) text += '/';
    for (int x = 0; x < picture.width(); ++x) text += picture.at(x, y)[3] ? '#' : '.';
  }
  return text;
}

}  // namespace

TEST_CASE("a rectangle's border lies inside its box", "[writers]") {
  Image<Rgba8> picture(6, 5, Rgba8{});
  draw_rectangle(picture, {1, 1, 6, 5}, 1, kInk);
  CHECK(drawn(picture) == "....../.#####/.#...#/.#...#/.#####");
  picture = Image<Rgba8>(6, 5, Rgba8{});
  draw_rectangle(picture, {1, 0, 6, 5}, 2, kInk);
  CHECK(drawn(picture) == ".#####/.#####/.##.##/.#####/.#####");
  picture = Image<Rgba8>(6, 5, Rgba8{});
  draw_rectangle(picture, {-2, -2, 2, 2}, 1, kInk);
  CHECK(drawn(picture) == ".#..../##..../....../....../......");
}

TEST_CASE("lines join their ends, are smooth and stop at the picture's edge", "[writers]") {
  Image<Rgba8> picture(12, 8, Rgba8{});
  draw_line(picture, {0.5, 0.5}, {11.5, 6.0}, 2, kInk);
  CHECK(picture.at(0, 0)[3] > 100);
  CHECK(picture.at(11, 5)[3] > 100);
  // The edge of a slanted line is partly covered, and never darkened.
  int smooth = 0;
  for (const Rgba8& pixel : picture.pixels()) {
    if (pixel[3] > 0 && pixel[3] < 255) ++smooth;
    if (pixel[3] > 0) CHECK(pixel[0] == 255);
  }
  CHECK(smooth > 8);
  picture = Image<Rgba8>(6, 5, Rgba8{});
  draw_line(picture, {-1e9, 2.5}, {1e9, 2.5}, 3, kInk);
  for (int x = 0; x < 6; ++x) {
    CHECK(picture.at(x, 2) == kInk);
    CHECK(picture.at(x, 1)[3] > 160);
    CHECK(picture.at(x, 3)[3] > 160);
    CHECK(picture.at(x, 0)[3] < 80);
    CHECK(picture.at(x, 4)[3] < 80);
  }
  picture = Image<Rgba8>(6, 4, Rgba8{});
  draw_line(picture, {-1e300, 1.5}, {3.0, 3.0}, 1, kInk);
  draw_line(picture, {1.0, 1.0}, {3.0, 3.0}, 0, kInk);
  draw_line(picture, {-5.0, -9.0}, {8.0, -2.0}, 2, kInk);
  draw_line(picture, {std::nan(""), 0.0}, {3.0, 3.0}, 1, kInk);
  CHECK(drawn(picture) == "....../....../....../......");
}

TEST_CASE("translucent ink blends over what is there, once a call", "[writers]") {
  Image<Rgba8> picture(1, 1, Rgba8{0, 0, 100, 255});
  fill_rectangle(picture, {0, 0, 1, 1}, {200, 0, 0, 128});
  CHECK(picture.at(0, 0) == Rgba8{100, 0, 50, 255});
  picture = Image<Rgba8>(9, 9, Rgba8{});
  draw_rectangle(picture, {1, 1, 8, 8}, 2, {200, 0, 0, 128});
  CHECK(picture.at(1, 1) == Rgba8{200, 0, 0, 128});  // a corner is two sides
  CHECK(picture.at(4, 2) == Rgba8{200, 0, 0, 128});
}

TEST_CASE("circles are round, and of any size and place", "[writers]") {
  Image<Rgba8> picture(21, 21, Rgba8{});
  fill_circle(picture, {10.5, 10.5}, 5.0, kInk);
  double covered = 0.0;
  for (const Rgba8& pixel : picture.pixels()) covered += pixel[3] / 255.0;
  CHECK(covered == Approx(kPi * 25.0).epsilon(0.1));
  for (int i = 0; i < 21; ++i) {
    CHECK(std::abs(picture.at(i, 10)[3] - picture.at(20 - i, 10)[3]) < 8);
    CHECK(std::abs(picture.at(i, 10)[3] - picture.at(10, i)[3]) < 8);
  }
  const Image<Rgba8> before = picture;
  fill_circle(picture, {-1e30, 3.0}, 5.0, kInk);
  fill_circle(picture, {std::nan(""), 3.0}, 5.0, kInk);
  fill_circle(picture, {50.0, 3.0}, 5.0, kInk);
  CHECK(picture == before);
}

TEST_CASE("a tag is a plate with letters above its box, inside the picture", "[writers]") {
  const Rgba8 yellow{255, 230, 0, 255};
  Image<Rgba8> picture(200, 120, Rgba8{});
  draw_tag(picture, {20, 60, 90, 100}, "banana", yellow);
  std::size_t plate = 0;
  std::size_t dark = 0;
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 200; ++x) {
      const Rgba8& pixel = picture.at(x, y);
      if (pixel[3] == 0) continue;
      CHECK(y < 60);
      CHECK(x >= 20);
      if (pixel == yellow) ++plate;
      if (pixel[0] < 60) ++dark;
    }
  }
  CHECK(plate > 200);
  CHECK(dark > 40);  // black is read on yellow
  // At the upper right corner it moves inside.
  for (const PixelBox& box : {PixelBox{190, 0, 200, 10}, PixelBox{-50, -50, 300, 300}}) {
    Image<Rgba8> other(200, 120, Rgba8{});
    draw_tag(other, box, "mug", {0, 0, 90, 255});
    std::size_t bright = 0;
    for (const Rgba8& pixel : other.pixels()) bright += pixel[0] > 200 ? 1 : 0;
    CHECK(bright > 15);
  }
  // Whatever the text is and however small the picture.
  Image<Rgba8> tiny(3, 2, Rgba8{});
  draw_tag(tiny, {0, 0, 3, 2}, "\xF0\x9F\x8D\x8C\xFF\n\x01 a text that is longer", kInk);
  CHECK(tiny.at(0, 0)[3] == 255);
}

TEST_CASE("a mask is filled inside its outline, holes are not", "[writers]") {
  Image<std::uint32_t> ids(20, 20, 0);
  for (int y = 4; y < 16; ++y) {
    for (int x = 4; x < 16; ++x) ids.at(x, y) = x > 8 && x < 12 && y > 8 && y < 12 ? 5 : 7;
  }
  Image<Rgba8> picture(20, 20, Rgba8{0, 0, 0, 255});
  fill_mask(picture, ids, 7, {4, 4, 16, 16}, 1, {255, 0, 0, 128});
  CHECK(picture.at(6, 6) == Rgba8{128, 0, 0, 255});
  CHECK(picture.at(10, 10) == Rgba8{0, 0, 0, 255});
  CHECK(picture.at(4, 10)[0] > 220);  // the outline is in full ink
  CHECK(picture.at(1, 1) == Rgba8{0, 0, 0, 255});
}

TEST_CASE("a world line is clipped at the near plane instead of smeared", "[writers]") {
  Frame frame;
  frame.camera = Camera::from_lens(40, 20, 24.0, 20.955);
  frame.camera.near_m = 0.5;
  Image<Rgba8> picture(40, 20, Rgba8{});
  // Along the axis from behind the camera: one point in the middle.
  draw_world_line(picture, frame, {0.0, 0.0, 3.0}, {0.0, 0.0, -3.0}, 1, kInk);
  CHECK(drawn(picture).find('#') != std::string::npos);
  CHECK(picture.at(20, 10)[3] > 0);
  CHECK(picture.at(25, 10)[3] == 0);
  picture = Image<Rgba8>(40, 20, Rgba8{});
  draw_world_line(picture, frame, {-1.0, 0.0, 3.0}, {1.0, 0.0, 2.0}, 1, kInk);
  CHECK(drawn(picture).find('#') == std::string::npos);
}
