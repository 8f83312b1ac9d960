// SPDX-License-Identifier: Apache-2.0
#include "writer_voc/voc_writer.h"

#include <array>
#include <string>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"

using namespace diorama;
using test::MemoryFiles;

TEST_CASE("annotations count pixels from one and include the last", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<VocWriter>({}, host);
  const Frame& frame = test::sample_captures()[0].frames[0];
  const std::string xml = files.text("Annotations/000000_cam_0.xml");
  CHECK(xml.find("<filename>000000_cam_0.jpg</filename>") != std::string::npos);
  CHECK(xml.find("<size><width>72</width><height>48</height><depth>3</depth></size>") !=
        std::string::npos);
  const PixelBox& box = *test::instance_at(frame, "/Assets/mug").tight_box;
  const std::string expected = "<bndbox><xmin>" + std::to_string(box.x_min + 1) + "</xmin><ymin>" +
                               std::to_string(box.y_min + 1) + "</ymin><xmax>" +
                               std::to_string(box.x_max) + "</xmax><ymax>" +
                               std::to_string(box.y_max) + "</ymax></bndbox>";
  const std::size_t mug = xml.find("<name>mug</name>");
  REQUIRE(mug != std::string::npos);
  CHECK(xml.find(expected) > mug);
  CHECK(xml.substr(mug, xml.find("</object>", mug) - mug).find("<occluded>1") != std::string::npos);
  const std::size_t ball = xml.find("<name>ball</name>");
  CHECK(xml.substr(ball, xml.find("</object>", ball) - ball).find("<truncated>1") !=
        std::string::npos);
}

TEST_CASE("segmentation pictures hold class and object numbers", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<VocWriter>({}, host);
  const Frame& frame = test::sample_captures()[1].frames[1];
  const test::RawImage classes = test::raw_image(files.bytes("SegmentationClass/000001_cam_1.png"));
  const test::RawImage objects =
      test::raw_image(files.bytes("SegmentationObject/000001_cam_1.png"));
  std::map<std::uint32_t, int> object_of_id;
  for (const Instance& instance : frame.instances) {
    if (instance.tight_box) object_of_id.emplace(instance.id, int(object_of_id.size()) + 1);
  }
  const std::map<std::string, int> class_number{{"ball", 1}, {"crate", 2}, {"mug", 3}};
  for (int y = 0; y < classes.height; ++y) {
    for (int x = 0; x < classes.width; ++x) {
      const std::uint32_t id = frame.get(kInstanceId).at(x, y);
      int expected = 0;
      for (const Instance& instance : frame.instances) {
        if (id != 0 && instance.id == id) expected = class_number.at(instance.labels.at("class"));
      }
      CHECK(classes.at(x, y, 0) == expected);
      CHECK(objects.at(x, y, 0) == (id == 0 ? 0 : object_of_id.at(id)));
    }
  }
}

TEST_CASE("image sets list every picture once", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<VocWriter>({}, host);
  const std::string all = files.text("ImageSets/Main/trainval.txt");
  CHECK(all.starts_with("000000_cam_0\n000000_cam_1\n000001_cam_0\n"));
  CHECK(files.text("ImageSets/Main/train.txt").size() +
            files.text("ImageSets/Main/val.txt").size() ==
        all.size());
  CHECK(files.text("labels.txt") == "ball\ncrate\nmug\n");
}

TEST_CASE("segmentation pictures carry the benchmark's palette", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<VocWriter>({}, host);
  for (const char* folder : {"SegmentationClass", "SegmentationObject"}) {
    const std::string path = std::string(folder) + "/000001_cam_1.png";
    const auto& palette = test::raw_image(files.bytes(path)).palette;
    REQUIRE(palette.size() == 3 * 256);
    const auto color = [&](std::size_t index) {
      return std::array{int(palette[3 * index]), int(palette[3 * index + 1]),
                        int(palette[3 * index + 2])};
    };
    // Of the development kit: background, aeroplane, bicycle, bird, bottle, tv monitor, void.
    CHECK(color(0) == std::array{0, 0, 0});
    CHECK(color(1) == std::array{128, 0, 0});
    CHECK(color(2) == std::array{0, 128, 0});
    CHECK(color(3) == std::array{128, 128, 0});
    CHECK(color(5) == std::array{128, 0, 128});
    CHECK(color(20) == std::array{0, 64, 128});
    CHECK(color(255) == std::array{224, 224, 192});
  }
}

TEST_CASE("each class has lists of the pictures that show it", "[writers]") {
  test::FakeHost host;
  VocWriter::Params params;
  params.difficult_below = 0.9;
  params.training.classes = {"mug", "ball", "no such/thing", "no such?thing"};
  const MemoryFiles files = test::write_sample<VocWriter>(params, host);
  const std::string lists = "ImageSets/Main/";
  std::string mugs, balls;
  for (const Capture& capture : test::sample_captures()) {
    for (const Frame& frame : capture.frames) {
      const std::string stem = "00000" + std::to_string(capture.index) + "_" + frame.camera_name;
      const auto mark = [&](const std::string& path) -> std::string {
        const Instance& instance = test::instance_at(frame, path);
        if (!instance.tight_box) return " -1\n";
        return instance.visibility->occlusion().value() > 0.1 ? "  0\n" : "  1\n";
      };
      mugs += stem + mark("/Assets/mug");
      balls += stem + mark("/Assets/ball");
    }
  }
  CHECK(files.text(lists + "mug_trainval.txt") == mugs);
  CHECK(files.text(lists + "ball_trainval.txt") == balls);
  CHECK(mugs.find("  0\n") != std::string::npos);
  CHECK(mugs.find("  1\n") != std::string::npos);
  CHECK(files.text(lists + "mug_train.txt").size() + files.text(lists + "mug_val.txt").size() ==
        mugs.size());
  CHECK(files.text(lists + "no_such_thing_trainval.txt").find(" 1") == std::string::npos);
  CHECK(files.files.contains(lists + "no_such_thing_2_train.txt"));
}
