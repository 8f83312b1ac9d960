// SPDX-License-Identifier: Apache-2.0
#include "writer_support/canvas.h"

#include <string>

#include "support/catch.h"
#include "writer_support/color_names.h"

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

TEST_CASE("lines join their ends and stop at the picture's edge", "[writers]") {
  Image<Rgba8> picture(6, 4, Rgba8{});
  draw_line(picture, {0.5, 0.5}, {5.5, 3.5}, 1, kInk);
  CHECK(picture.at(0, 0) == kInk);
  CHECK(picture.at(5, 3) == kInk);
  picture = Image<Rgba8>(6, 4, Rgba8{});
  draw_line(picture, {-1e9, 1.5}, {1e9, 1.5}, 1, kInk);
  CHECK(drawn(picture) == "....../######/....../......");
  picture = Image<Rgba8>(6, 4, Rgba8{});
  draw_line(picture, {-5.0, -9.0}, {8.0, -2.0}, 2, kInk);
  draw_line(picture, {std::nan(""), 0.0}, {3.0, 3.0}, 1, kInk);
  CHECK(drawn(picture) == "....../....../....../......");
}

TEST_CASE("translucent ink blends over what is there", "[writers]") {
  Image<Rgba8> picture(1, 1, Rgba8{0, 0, 100, 255});
  draw_pixel(picture, 0, 0, {200, 0, 0, 128});
  CHECK(picture.at(0, 0) == Rgba8{100, 0, 50, 255});
}

TEST_CASE("a world line is clipped at the near plane instead of smeared", "[writers]") {
  Frame frame;
  frame.camera = Camera::from_lens(40, 20, 24.0, 20.955);
  frame.camera.near_m = 0.5;
  Image<Rgba8> picture(40, 20, Rgba8{});
  // Along the axis from behind the camera: one point in the middle.
  draw_world_line(picture, frame, {0.0, 0.0, 3.0}, {0.0, 0.0, -3.0}, 1, kInk);
  CHECK(drawn(picture).find('#') != std::string::npos);
  CHECK(picture.at(20, 10) == kInk);
  CHECK(picture.at(25, 10)[3] == 0);
  picture = Image<Rgba8>(40, 20, Rgba8{});
  draw_world_line(picture, frame, {-1.0, 0.0, 3.0}, {1.0, 0.0, 2.0}, 1, kInk);
  CHECK(drawn(picture).find('#') == std::string::npos);
}

TEST_CASE("colours are read as Pillow reads them", "[writers]") {
  CHECK(color_from_text("Green") == Rgba8{0, 128, 0, 255});
  CHECK(color_from_text("rebeccapurple") == Rgba8{102, 51, 153, 255});
  CHECK(color_from_text("#f80") == Rgba8{255, 136, 0, 255});
  CHECK(color_from_text("#10203040") == Rgba8{16, 32, 48, 64});
  CHECK_FALSE(color_from_text("#12345"));
  CHECK_FALSE(color_from_text("grun"));
  Value list = Value::make_list();
  for (const int part : {1, 2, 255}) list.list.push_back(Value::integer(part));
  CHECK(color_from_value(list, "fill") == Rgba8{1, 2, 255, 255});
  list.list.back() = Value::integer(256);
  CHECK_THROWS_WITH(color_from_value(list, "fill"), ContainsSubstring("fill: expected a colour"));
}
