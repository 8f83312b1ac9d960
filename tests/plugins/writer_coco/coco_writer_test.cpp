// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/coco_writer.h"

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_support/run_length.h"

using namespace diorama;
using test::MemoryFiles;

namespace {

/// The COCO API's text read back on its own: pixels in column order, one character each.
std::string decoded(const Json& rle) {
  const std::string text = rle.at("counts");
  std::vector<long> counts;
  std::size_t at = 0;
  while (at < text.size()) {
    long value = 0;
    int groups = 0;
    for (bool more = true; more; ++groups) {
      const int c = text.at(at++) - 48;
      REQUIRE(c >= 0);
      REQUIRE(c < 64);
      value += long(c % 32) << (5 * groups);
      more = c >= 32;
      if (!more && c % 32 >= 16) value -= 1L << (5 * (groups + 1));
    }
    if (counts.size() >= 3) value += counts[counts.size() - 2];
    counts.push_back(value);
  }
  std::string pixels;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    REQUIRE(counts[i] >= 0);
    pixels.append(std::size_t(counts[i]), i % 2 == 0 ? '.' : '#');
  }
  REQUIRE(pixels.size() ==
          rle.at("size")[0].get<std::size_t>() * rle.at("size")[1].get<std::size_t>());
  return pixels;
}

std::string columns_of(const Image<std::uint32_t>& ids, std::uint32_t id) {
  std::string pixels;
  for (int x = 0; x < ids.width(); ++x) {
    for (int y = 0; y < ids.height(); ++y) pixels += ids.at(x, y) == id ? '#' : '.';
  }
  return pixels;
}

MemoryFiles write(const CocoWriter::Params& params) {
  test::FakeHost host;
  return test::write_sample<CocoWriter>(params, host);
}

}  // namespace

TEST_CASE("run lengths have the COCO API's text", "[writers]") {
  // By hand: columns "##.", ".#.", "..." give the runs 0 2 2 1 4.
  Image<std::uint32_t> ids(3, 3, 0);
  ids.at(0, 0) = ids.at(0, 1) = ids.at(1, 1) = 5;
  const RunLength mask = run_length(ids, 5, {0, 0, 2, 2});
  CHECK(mask.counts == std::vector<std::uint32_t>{0, 2, 2, 1, 4});
  // The fourth is told as its difference to the second, -1; the fifth to the third, 2.
  CHECK(coco_rle(mask).at("counts") == "022O2");
  CHECK(decoded(coco_rle(mask)) == columns_of(ids, 5));
}

TEST_CASE("every annotation's mask, box and area are those of its pixels", "[writers]") {
  const MemoryFiles files = write({});
  std::size_t masks = 0;
  for (const std::string split : {"train", "val"}) {
    const Json json = Json::parse(files.text("annotations/instances_" + split + ".json"));
    int expected_id = 0;
    for (const Json& annotation : json.at("annotations")) {
      CHECK(annotation.at("id") == ++expected_id);
      const int image = annotation.at("image_id").get<int>() - 1;
      const Frame& frame =
          test::sample_captures()[std::size_t(image / 2)].frames[std::size_t(image % 2)];
      const Instance& instance = test::instance_at(frame, annotation.at("node"));
      const auto& ids = frame.get(kInstanceId);
      CHECK(decoded(annotation.at("segmentation")) == columns_of(ids, instance.id));
      CHECK(annotation.at("area") == test::visible_count(frame, instance));
      CHECK(annotation.at("bbox") == Json{instance.tight_box->x_min, instance.tight_box->y_min,
                                          instance.tight_box->width(),
                                          instance.tight_box->height()});
      const std::string whole = decoded(annotation.at("amodal").at("segmentation"));
      CHECK(std::int64_t(std::count(whole.begin(), whole.end(), '#')) ==
            instance.visibility->amodal_pixels);
      const int category = annotation.at("category_id");
      CHECK(json.at("categories")[std::size_t(category - 1)].at("name") ==
            instance.labels.at("class"));
      ++masks;
    }
  }
  CHECK(masks >= 15);
}

TEST_CASE("captures are split as a whole and pictures lie where the annotations say", "[writers]") {
  const MemoryFiles files = write({});
  int images = 0;
  for (const std::string split : {"train", "val"}) {
    const Json json = Json::parse(files.text("annotations/instances_" + split + ".json"));
    for (const Json& image : json.at("images")) {
      ++images;
      CHECK(test::split_of(files, image.at("capture")) == split);
      CHECK(files.paths().contains("images/" + split + "/" +
                                   image.at("file_name").get<std::string>()));
    }
  }
  CHECK(images == 6);
}

TEST_CASE("panoptic pictures hold the ids of their segments", "[writers]") {
  const MemoryFiles files = write({});
  const Json json = Json::parse(files.text("annotations/panoptic_train.json"));
  for (const Json& annotation : json.at("annotations")) {
    const test::RawImage picture = test::raw_image(
        files.bytes("panoptic/train/" + annotation.at("file_name").get<std::string>()));
    std::map<int, std::int64_t> counts;
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        ++counts[picture.at(x, y, 0) + 256 * picture.at(x, y, 1) + 65536 * picture.at(x, y, 2)];
      }
    }
    CHECK(counts.size() == annotation.at("segments_info").size() + 1);
    for (const Json& segment : annotation.at("segments_info")) {
      CHECK(counts[segment.at("id")] == segment.at("area").get<std::int64_t>());
    }
  }
}

TEST_CASE("keypoints tell hidden from visible from outside", "[writers]") {
  const MemoryFiles files = write({});
  std::set<int> states;
  for (const std::string split : {"train", "val"}) {
    const Json json = Json::parse(files.text("annotations/instances_" + split + ".json"));
    for (const Json& annotation : json.at("annotations")) {
      REQUIRE(annotation.at("keypoints").size() == 27);
      CHECK(annotation.at("keypoints")[2] != 2);  // a box's middle is never in sight
      for (std::size_t i = 2; i < 27; i += 3) states.insert(annotation["keypoints"][i].get<int>());
    }
  }
  CHECK(states == std::set<int>{0, 1, 2});
}

TEST_CASE("small objects become crowd, unlisted classes are left out", "[writers]") {
  CocoWriter::Params params;
  params.crowd_below_px = 1000000;
  params.training.classes = {"mug", "plate"};
  params.training.val_share = 0.0;
  const MemoryFiles files = write(params);
  CHECK_FALSE(files.paths().contains("annotations/instances_val.json"));
  const Json json = Json::parse(files.text("annotations/instances_train.json"));
  CHECK(json.at("categories").size() == 2);
  CHECK_FALSE(json.at("annotations").empty());
  for (const Json& annotation : json.at("annotations")) {
    CHECK(annotation.at("category_id") == 1);
    CHECK(annotation.at("iscrowd") == 1);
  }
}
