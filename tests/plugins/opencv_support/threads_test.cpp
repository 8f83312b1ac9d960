// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <thread>
#include <vector>

#include "opencv_support/canvas.h"
#include "opencv_support/color_maps.h"
#include "opencv_support/contours.h"
#include "support/catch.h"

using namespace diorama;

namespace {

std::size_t threads_of_process() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry :
       std::filesystem::directory_iterator("/proc/self/task")) {
    ++count;
  }
  return count;
}

struct Work {
  Image<Rgba8> picture{1400, 1000, Rgba8{20, 30, 40, 255}};
  Polygon polygon;

  Work() {
    Image<std::uint32_t> ids(1400, 1000, 0);
    std::uint32_t random = 5;
    for (int y = 100; y < 900; ++y) {
      for (int x = 200; x < 1200; ++x) {
        random = random * 1664525u + 1013904223u;
        ids.at(x, y) = (x / 50 + y / 40) % 7 == 0 && random % 64 == 0 ? 0 : 7;
      }
    }
    const PixelBox box{0, 0, 1400, 1000};
    const auto parts = outlines(ids, 7, box);
    polygon = parts[0].outer;
    for (const Vec2& corner : least_rectangle(parts)) polygon.push_back(corner);
    fill_mask(picture, ids, 7, box, 2, {200, 10, 10, 90});
    draw_line(picture, {-20.0, 3.0}, {1500.0, 900.0}, 5, {0, 255, 0, 200});
    draw_tag(picture, {30, 80, 100, 120}, "banana", {250, 240, 10, 255});
    Image<float> distances(1400, 1000, 1.0f);
    for (std::size_t i = 0; i < distances.pixels().size(); ++i) {
      distances.pixels()[i] = 1.0f + float(i % 977) * 0.01f;
    }
    const auto colors = distance_colors(distances, distance_range(distances));
    for (std::size_t i = 0; i < colors.pixels().size(); i += 3) {
      picture.pixels()[i] = colors.pixels()[i];
    }
  }
};

}  // namespace

TEST_CASE("OpenCV starts no threads, and any number of ours get the same bytes", "[writers]") {
  const std::size_t before = threads_of_process();
  const Work alone;
  CHECK(threads_of_process() == before);
  std::vector<Work> works(4);
  {
    std::vector<std::jthread> threads;
    for (Work& work : works) threads.emplace_back([&work] { work = Work(); });
  }
  CHECK(threads_of_process() == before);
  for (const Work& work : works) {
    CHECK(work.picture == alone.picture);
    CHECK(work.polygon == alone.polygon);
  }
}
