// SPDX-License-Identifier: Apache-2.0
#include "writer_yolo/yolo_writer.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "opencv_support/contours.h"
#include "plugins/writer_support/keypoint_sample.h"
#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"

using namespace diorama;
using test::MemoryFiles;

namespace {

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

TEST_CASE("boxes may be looser than what is seen, but stay in the picture", "[writers]") {
  test::FakeHost host;
  YoloWriter::Params params;
  params.box_margin = 0.5;
  const MemoryFiles loose = test::write_sample<YoloWriter>(params, host);
  const MemoryFiles tight = write("detect");
  CHECK(loose.text("dataset.json").find("box_margin") != std::string::npos);
  CHECK(tight.text("dataset.json").find("box_margin") == std::string::npos);
  const std::string file = label_file(loose, 0, "cam_0");
  const auto looser = numbers_of(loose.text(file)), lines = numbers_of(tight.text(file));
  REQUIRE(looser.size() == lines.size());
  REQUIRE_FALSE(lines.empty());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    CHECK(looser[i][0] == lines[i][0]);
    for (const std::size_t axis : {1u, 2u}) {
      const Camera& camera = test::sample_captures()[0].frames[0].camera;
      const double size = axis == 1 ? camera.width : camera.height;
      const double middle = size * lines[i][axis], reach = 0.75 * size * lines[i][axis + 2];
      const double low = size * (looser[i][axis] - 0.5 * looser[i][axis + 2]);
      const double high = size * (looser[i][axis] + 0.5 * looser[i][axis + 2]);
      CHECK(low == Approx(std::max(0.0, std::floor(middle - reach + 1e-3))).margin(1e-3));
      CHECK(high == Approx(std::min(size, std::ceil(middle + reach - 1e-3))).margin(1e-3));
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

TEST_CASE("pose lines hold the keypoints that a job names, for all classes alike", "[writers]") {
  const test::KeypointSample named;
  test::FakeHost host;
  YoloWriter::Params params;
  params.task = "pose";
  YoloWriter writer(params, host);
  const MemoryFiles files = test::write_dataset(writer, named.dataset, {&named.capture});
  CHECK_THAT(files.text("data.yaml"), ContainsSubstring("kpt_shape: [4, 3]\n"));
  CHECK_THAT(files.text("dataset.json"),
             ContainsSubstring("\"outside\",") && ContainsSubstring("\"gone\","));
  bool has_crate = false;
  for (const auto& line : numbers_of(files.text(label_file(files, 0, "cam_0")))) {
    REQUIRE(line.size() == 1 + 4 + 12);
    const bool is_crate = line[0] == 1;
    // Outside, seen, gone, hidden.
    for (std::size_t i = 0; i < 4; ++i) {
      const double expected = !is_crate ? 0.0 : i == 1 ? 2.0 : i == 3 ? 1.0 : 0.0;
      CHECK(line[5 + 3 * i + 2] == expected);
      const bool is_there = expected > 0.0;
      CHECK(line[5 + 3 * i] == Approx(is_there ? named.pixel.x() / 48.0 : 0.0).margin(1e-4));
      CHECK(line[5 + 3 * i + 1] == Approx(is_there ? named.pixel.y() / 32.0 : 0.0).margin(1e-4));
    }
    has_crate |= is_crate;
  }
  CHECK(has_crate);
}
