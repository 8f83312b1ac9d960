// SPDX-License-Identifier: Apache-2.0
#include "writer_yolo/yolo_writer.h"

#include <sstream>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_support/contours.h"

using namespace diorama;
using test::MemoryFiles;

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

std::vector<std::vector<double>> numbers_of(const std::string& text) {
  std::vector<std::vector<double>> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    lines.emplace_back();
    for (double value = 0.0; words >> value;) lines.back().push_back(value);
  }
  return lines;
}

MemoryFiles write(const std::string& task) {
  test::FakeHost host;
  YoloWriter::Params params;
  params.task = task;
  return test::write_sample<YoloWriter>(params, host);
}

std::string label_file(const MemoryFiles& files, int capture, const std::string& camera) {
  return "labels/" + test::split_of(files, capture) + "/00000" + std::to_string(capture) + "_" +
         camera + ".txt";
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
  // Holes that touch at a corner are one.
  CHECK(parts[0].holes.size() == 3);
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

  // Noise: every kind of contact.
  Image<std::uint32_t> noise(23, 17, 0);
  std::uint32_t random = 3;
  for (std::uint32_t& pixel : noise.pixels()) {
    random = random * 1664525u + 1013904223u;
    pixel = (random >> 16) % 5 < 3 ? 7 : 0;
  }
  const Polygon all = joined(outlines(noise, 7, {0, 0, 23, 17}));
  for (int y = 0; y < noise.height(); ++y) {
    for (int x = 0; x < noise.width(); ++x) {
      CHECK(is_inside(all, {x + 0.5, y + 0.5}) == (noise.at(x, y) == 7));
      CHECK(winding(all, {x + 0.5, y + 0.5}) == (noise.at(x, y) == 7 ? 1 : 0));
    }
  }
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

TEST_CASE("detection lines are boxes in shares of the image", "[writers]") {
  const MemoryFiles files = write("detect");
  for (const Capture& capture : test::sample_captures()) {
    for (const Frame& frame : capture.frames) {
      const auto lines =
          numbers_of(files.text(label_file(files, capture.index, frame.camera_name)));
      std::size_t row = 0;
      for (const Instance& instance : frame.instances) {
        if (!instance.tight_box) continue;
        const auto& line = lines.at(row++);
        const PixelBox& box = *instance.tight_box;
        const std::map<std::string, int> classes{{"ball", 0}, {"crate", 1}, {"mug", 2}};
        CHECK(line.at(0) == classes.at(instance.labels.at("class")));
        CHECK((line[1] - 0.5 * line[3]) * frame.camera.width == Approx(box.x_min).margin(1e-3));
        CHECK((line[2] + 0.5 * line[4]) * frame.camera.height == Approx(box.y_max).margin(1e-3));
      }
      CHECK(row == lines.size());
    }
  }
}

TEST_CASE("polygons hold the object's pixels and no others", "[writers]") {
  const MemoryFiles files = write("segment");
  const Capture& capture = test::sample_captures()[0];
  const Frame& frame = capture.frames[0];
  const auto lines = numbers_of(files.text(label_file(files, 0, "cam_0")));
  std::size_t row = 0;
  for (const Instance& instance : frame.instances) {
    if (!instance.tight_box) continue;
    const auto& line = lines.at(row++);
    Polygon polygon;
    for (std::size_t i = 1; i + 1 < line.size(); i += 2) {
      polygon.emplace_back(line[i] * frame.camera.width, line[i + 1] * frame.camera.height);
    }
    std::int64_t inside = 0;
    for (int y = 0; y < frame.camera.height; ++y) {
      for (int x = 0; x < frame.camera.width; ++x) {
        const bool is_own = frame.get(kInstanceId).at(x, y) == instance.id;
        if (is_own) CHECK(is_inside(polygon, {x + 0.5, y + 0.5}));
        if (is_inside(polygon, {x + 0.5, y + 0.5})) ++inside;
      }
    }
    CHECK(inside == test::visible_count(frame, instance));  // none of them has a hole here
  }
}

TEST_CASE("pose lines and data.yaml agree on nine keypoints", "[writers]") {
  const MemoryFiles files = write("pose");
  CHECK(files.text("data.yaml") ==
        "train: images/train\nval: images/val\nkpt_shape: [9, 3]\nnames:\n"
        "  0: \"ball\"\n  1: \"crate\"\n  2: \"mug\"\n");
  for (const auto& line : numbers_of(files.text(label_file(files, 1, "cam_1")))) {
    CHECK(line.size() == 1 + 4 + 27);
  }
}
