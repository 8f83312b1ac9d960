// SPDX-License-Identifier: Apache-2.0
#include "writer_voc/voc_writer.h"

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
