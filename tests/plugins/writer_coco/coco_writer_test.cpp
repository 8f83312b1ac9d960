// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/coco_writer.h"

#include "plugins/writer_support/keypoint_sample.h"
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
  std::size_t orders = 0;
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
      Json occluded_by = Json::array();
      for (const Occlusion& occlusion : frame.occlusions) {
        if (occlusion.behind != instance.id) continue;
        const auto front = std::ranges::find(frame.instances, occlusion.front, &Instance::id);
        occluded_by.push_back({{"node", front->node_path}, {"pixels", occlusion.pixels}});
      }
      CHECK(annotation.at("amodal").at("occluded_by") == occluded_by);
      orders += occluded_by.size();
      const int category = annotation.at("category_id");
      CHECK(json.at("categories")[std::size_t(category - 1)].at("name") ==
            instance.labels.at("class"));
      ++masks;
    }
  }
  CHECK(masks >= 15);
  CHECK(orders > 0);
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

TEST_CASE("keypoints that a job names take the place of the box's", "[writers]") {
  const test::KeypointSample named;
  test::FakeHost host;
  CocoWriter writer({}, host);
  const MemoryFiles files = test::write_dataset(writer, named.dataset, {&named.capture});
  const Json json =
      Json::parse(files.text("annotations/instances_" + test::split_of(files, 0) + ".json"));
  std::map<int, std::string> names;
  for (const Json& category : json.at("categories")) {
    names[category["id"]] = category["name"];
    if (category["name"] != "crate") {
      CHECK(category["keypoints"][0] == "Center");
      continue;
    }
    CHECK(category["keypoints"] == Json::array({"outside", "seen", "gone", "hidden"}));
    CHECK(category["skeleton"].empty());
  }
  int crates = 0;
  for (const Json& annotation : json.at("annotations")) {
    const bool is_crate = names.at(annotation["category_id"]) == "crate";
    CHECK(annotation["keypoints"].size() == (is_crate ? 12u : 27u));
    if (annotation["node"] != "/Assets/crate" || annotation["image_id"] != 1) continue;
    ++crates;
    const Json& points = annotation["keypoints"];
    CHECK(annotation["num_keypoints"] == 2);
    CHECK(points[2] == 0);
    CHECK(points[5] == 2);
    CHECK(points[8] == 0);
    CHECK(points[11] == 1);
    for (const std::size_t at : {3u, 9u}) {
      CHECK(points[at].get<double>() == Approx(named.pixel.x()).margin(2e-3));
      CHECK(points[at + 1].get<double>() == Approx(named.pixel.y()).margin(2e-3));
    }
  }
  CHECK(crates == 1);
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

namespace {

Value category(const char* name, int id) {
  Value entry = Value::make_map();
  entry.set("name", Value::text(name));
  entry.set("id", Value::integer(id));
  return entry;
}

}  // namespace

TEST_CASE("Replicator's categories are taken with their ids, the rest is other", "[writers]") {
  CocoWriter::Params params;
  params.training.val_share = 0.0;
  params.coco_categories = Value::make_map();
  Value cup = category("Cup", 47);
  cup.set("supercategory", Value::text("kitchen"));
  cup.set("isthing", Value::integer(0));
  Value color = Value::make_list();
  for (const int channel : {1, 2, 3}) color.list.push_back(Value::integer(channel));
  cup.set("color", color);
  params.coco_categories.set("mug", cup);
  params.coco_categories.set("ball", category("sports ball", 37));
  params.coco_license_info = Value::make_list();
  params.coco_license_info.list.push_back(category("free", 1));
  params.image_output_format = "jpeg";
  params.dataset_id = "abc";
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<CocoWriter>(params, host);
  CHECK(host.messages ==
        std::vector<std::string>{
            "CocoWriter: dataset_id has no effect: names of files do not carry it"});
  const Json json = Json::parse(files.text("annotations/instances_train.json"));
  CHECK(json.at("licenses") == Json::array({{{"name", "free"}, {"id", 1}}}));
  CHECK(json.at("categories")[0].at("id") == 47);
  CHECK(json.at("categories")[0].at("name") == "Cup");
  CHECK(json.at("categories")[0].at("supercategory") == "kitchen");
  CHECK(json.at("categories")[0].at("isthing") == 0);
  CHECK(json.at("categories")[0].at("color") == Json{1, 2, 3});
  CHECK(json.at("categories")[2].at("name") == "other");
  CHECK(json.at("images")[0].at("file_name") == "000000_cam_0.jpg");
  for (const Json& annotation : json.at("annotations")) {
    const std::string node = annotation.at("node");
    CHECK(annotation.at("category_id") == (node == "/Assets/mug"    ? 47
                                           : node == "/Assets/ball" ? 37
                                                                    : 201));
  }
}

TEST_CASE("semantic types choose which label is the class, in their order", "[writers]") {
  CocoWriter::Params params;
  params.training.classes = {"cuboid", "mug"};
  params.training.val_share = 0.0;
  params.labels.semantic_types = Value::make_list();
  for (const char* type : {"shape", "class"}) {
    params.labels.semantic_types.list.push_back(Value::text(type));
  }
  const Json json = Json::parse(write(params).text("annotations/instances_train.json"));
  std::set<std::pair<std::string, int>> found;
  for (const Json& annotation : json.at("annotations")) {
    found.emplace(annotation.at("node"), annotation.at("category_id"));
  }
  CHECK(found == std::set<std::pair<std::string, int>>{{"/Assets/crate", 1}, {"/Assets/mug", 2}});
}

TEST_CASE("bad categories are refused with what is wrong", "[writers]") {
  test::FakeHost host;
  const auto refused = [&](const Value& categories, const std::string& message) {
    CocoWriter::Params params;
    params.coco_categories = categories;
    CHECK_THROWS_WITH(CocoWriter(params, host), message);
  };
  refused(Value::text("all"),
          "coco_categories: expected a mapping of labels to categories, found the text 'all'");
  Value map = Value::make_map();
  map.set("mug", category("Cup", 1));
  map.find("mug")->erase("id");
  refused(map, "coco_categories: 'mug' needs a name and a whole number as its id");
  map.set("mug", category("Cup", 1));
  map.set("ball", category("Ball", 1));
  refused(map, "coco_categories: id 1 is used twice");
  CocoWriter::Params remote;
  remote.remote.s3_bucket = "b";
  CHECK_THROWS_WITH(CocoWriter(remote, host),
                    "s3_bucket: found 'b'; files go to the output folder only, remove the key");
}

TEST_CASE("every picture's licence is in the list", "[writers]") {
  const Json json = Json::parse(write({}).text("annotations/instances_train.json"));
  REQUIRE(json.at("licenses").size() == 1);
  for (const Json& image : json.at("images")) {
    CHECK(image.at("license") == json.at("licenses")[0].at("id"));
  }
  CocoWriter::Params params;
  params.coco_license_info = Value::make_list();
  params.coco_license_info.list.push_back(category("free", 7));
  params.coco_license_info.list.push_back(category("other", 3));
  const Json two = Json::parse(write(params).text("annotations/panoptic_train.json"));
  for (const Json& image : two.at("images")) CHECK(image.at("license") == 7);
  params.coco_license_info.list[1] = category("same", 7);
  CHECK_THROWS_WITH(write(params), ContainsSubstring("two licences have this id"));
  params.coco_license_info.list[1].set("id", Value::text("seven"));
  CHECK_THROWS_WITH(write(params), ContainsSubstring("expected a whole number"));
}

TEST_CASE("polygons cover the pixels of the run lengths", "[writers]") {
  CocoWriter::Params params;
  params.segmentation = "polygon";
  const MemoryFiles polygons = write(params);
  const MemoryFiles runs = write({});
  for (const std::string split : {"train", "val"}) {
    const std::string path = "annotations/instances_" + split + ".json";
    const Json json = Json::parse(polygons.text(path));
    const Json expected = Json::parse(runs.text(path));
    std::map<int, std::pair<int, int>> sizes;
    for (const Json& image : json.at("images")) {
      sizes[image.at("id")] = {image.at("width"), image.at("height")};
    }
    REQUIRE(json.at("annotations").size() == expected.at("annotations").size());
    for (std::size_t i = 0; i < json.at("annotations").size(); ++i) {
      const Json& annotation = json.at("annotations")[i];
      const auto [width, height] = sizes.at(annotation.at("image_id"));
      const std::string mask = decoded(expected.at("annotations")[i].at("segmentation"));
      for (int x = 0; x < width; ++x) {
        for (int y = 0; y < height; ++y) {
          // Even-odd in each polygon; parts do not overlap.
          bool is_inside = false;
          for (const Json& polygon : annotation.at("segmentation")) {
            for (std::size_t a = 0; a < polygon.size(); a += 2) {
              const std::size_t b = (a + 2) % polygon.size();
              const double ay = polygon[a + 1], by = polygon[b + 1], ax = polygon[a],
                           bx = polygon[b];
              if ((ay > y + 0.5) == (by > y + 0.5)) continue;
              if (x + 0.5 < ax + (y + 0.5 - ay) / (by - ay) * (bx - ax)) is_inside = !is_inside;
            }
          }
          CHECK(is_inside == (mask[std::size_t(x * height + y)] == '#'));
        }
      }
    }
  }
}
