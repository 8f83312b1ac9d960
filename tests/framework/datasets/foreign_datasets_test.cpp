// SPDX-License-Identifier: Apache-2.0
// Datasets as other people's tools make them, by hand: their habits, not our writers'.
#include <algorithm>
#include <array>
#include <cmath>

#include "framework/datasets/opened_dataset.h"
#include "reader_support/stored_files.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace diorama;
using test::lint;
using Opened = test::OpenedDataset;

namespace {

std::string picture(int width, int height, std::uint8_t shade, ImageFormat format) {
  std::vector<std::uint8_t> samples;
  for (int i = 0; i < width * height; ++i) {
    samples.insert(samples.end(), {shade, std::uint8_t(i % 251), std::uint8_t(i / 7 % 251)});
  }
  return test::encoded({samples.data(), width, height, 3, 8}, format);
}

std::string gray(int width, int height, const std::vector<std::uint8_t>& samples) {
  return test::encoded({samples.data(), width, height, 1, 8});
}

bool finds(const LintReport& report, const std::string& check, const std::string& file) {
  return std::ranges::any_of(report.findings, [&](const LintFinding& finding) {
    return finding.check == check && finding.file.find(file) != std::string::npos;
  });
}

}  // namespace

TEST_CASE("COCO as its own tools have it: polygons, crowds, overlaps, split folders", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("val2017/000000000139.jpg", picture(40, 30, 90, ImageFormat::Jpeg));
  folder.write("val2017/000000000285.jpg", picture(32, 20, 70, ImageFormat::Jpeg));
  // Annotations before images, ids far apart, floats, an empty image, keys that mean nothing here.
  folder.write("annotations/instances_val2017.json", R"({
    "info": {"description": "x [ } \" ]", "year": 2017},
    "annotations": [
      {"id": 900100, "image_id": 139, "category_id": 18, "iscrowd": 0, "area": 70.5,
       "bbox": [3.5, 4.0, 10.25, 7.0],
       "segmentation": [[3.5, 4.0, 13.75, 4.0, 13.75, 11.0, 3.5, 11.0]]},
      {"id": 12, "image_id": 139, "category_id": 1, "iscrowd": 1, "area": 6,
       "bbox": [20, 10, 2, 3],
       "segmentation": {"size": [30, 40], "counts": [610, 3, 27, 3, 557]}}],
    "images": [
      {"id": 285, "file_name": "000000000285.jpg", "width": 32, "height": 20, "license": 4},
      {"id": 139, "file_name": "000000000139.jpg", "width": 40, "height": 30}],
    "categories": [{"id": 18, "name": "dog", "supercategory": "animal"}, {"id": 1, "name": "person"}]
  })");
  folder.write("annotations/captions_val2017.json", R"({"images": [], "annotations": []})");
  const Opened opened(folder, "CocoReader");
  CHECK(opened.dataset->info().captures == std::vector<int>{0, 1});
  CHECK(opened.dataset->info().camera_names == std::vector<std::string>{"camera"});
  CHECK_FALSE(opened.holds(kHoldsCamera));
  CHECK_FALSE(opened.holds(kHoldsPoses));
  CHECK_FALSE(opened.holds(kHoldsNodePaths));
  const StoredCapture first = opened.read(0);
  CHECK(first.split == "val2017");
  const Frame& frame = first.capture.frames.at(0);
  REQUIRE(frame.instances.size() == 2);
  CHECK(frame.instances[0].labels == Labels{{"class", "dog"}});
  CHECK(frame.instances[1].labels == Labels{{"class", "person"}, {"iscrowd", "1"}});
  CHECK(*frame.instances[0].tight_box == PixelBox{3, 4, 14, 11});
  CHECK(*frame.instances[1].tight_box == PixelBox{20, 10, 22, 13});
  const auto& ids = frame.get(kInstanceId);
  CHECK(ids.at(20, 10) == frame.instances[1].id);
  CHECK(ids.at(21, 12) == frame.instances[1].id);
  CHECK(ids.at(4, 4) == frame.instances[0].id);
  CHECK(ids.at(3, 4) == frame.instances[0].id);
  CHECK(ids.at(22, 12) == 0);
  CHECK(opened.read(1).capture.frames.at(0).instances.empty());
}

TEST_CASE("Keypoints of COCO and YOLO, with the lines between them", "[readers]") {
  using Sight = StoredKeypoint::Sight;
  const NameSet wanted{std::string(kHoldsKeypoints)};
  const test::TemporaryFolder coco;
  coco.write("images/a.png", picture(20, 20, 9, ImageFormat::Png));
  coco.write("annotations/instances_val.json", R"({
    "images": [{"id": 1, "file_name": "a.png", "width": 20, "height": 20}],
    "annotations": [{"id": 5, "image_id": 1, "category_id": 1, "bbox": [2, 2, 9, 9], "area": 81, "iscrowd": 0,
                     "keypoints": [3.5, 4, 2, 9, 10, 1, 0, 0, 0], "num_keypoints": 2}],
    "categories": [{"id": 1, "name": "person", "keypoints": ["nose", "hand", "foot"],
                    "skeleton": [[1, 2], [2, 3], [3, 4], [0, 1], "x", [1]]}]})");
  {
    const Opened opened(coco, "CocoReader");
    CHECK(opened.holds(kHoldsKeypoints));
    const StoredSkeleton& skeleton = opened.dataset->info().skeletons.at("person");
    CHECK(skeleton.names == std::vector<std::string>{"nose", "hand", "foot"});
    // Points are counted from 1; what is no line is left out.
    CHECK(skeleton.lines == std::vector<std::pair<int, int>>{{0, 1}, {1, 2}});
    const StoredCapture capture = opened.dataset->read(0, wanted);
    const auto& points =
        capture.keypoints.at(0).at(capture.capture.frames.at(0).instances.at(0).id);
    REQUIRE(points.size() == 3);
    CHECK(points[0].pixel == Vec2(3.5, 4.0));
    CHECK(points[0].sight == Sight::Seen);
    CHECK(points[1].sight == Sight::Hidden);
    CHECK(points[2].sight == Sight::NotTold);
    CHECK(opened.dataset->read(0, {}).keypoints.empty());
  }
  const test::TemporaryFolder yolo;
  yolo.write("data.yaml", "train: images/train\nnames: [person]\nkpt_shape: [2, 2]\n");
  yolo.write("images/train/a.png", picture(20, 10, 9, ImageFormat::Png));
  yolo.write("labels/train/a.txt", "0 0.5 0.5 0.4 0.4 0.5 0.6 0 0\n");
  const Opened opened(yolo, "YoloReader");
  CHECK(opened.holds(kHoldsKeypoints));
  CHECK(opened.dataset->info().skeletons.at("").lines.empty());
  const StoredCapture capture = opened.dataset->read(0, wanted);
  const auto& points = capture.keypoints.at(0).begin()->second;
  REQUIRE(points.size() == 2);
  CHECK(points[0].pixel.isApprox(Vec2(10.0, 6.0)));
  CHECK(points[0].sight == Sight::Seen);
  CHECK(points[1].sight == Sight::NotTold);
}

TEST_CASE("COCO masks that overlap are boxes still, but no picture of ids", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("images/a.png", picture(20, 20, 9, ImageFormat::Png));
  folder.write("annotations.json", R"({"images": [{"id": 1, "file_name": "a.png", "width": 20,
    "height": 20}], "categories": [{"id": 1, "name": "box"}], "annotations": [
    {"id": 1, "image_id": 1, "category_id": 1, "bbox": [1, 1, 8, 8],
     "segmentation": [[1, 1, 9, 1, 9, 9, 1, 9]]},
    {"id": 2, "image_id": 1, "category_id": 1, "bbox": [5, 5, 8, 8],
     "segmentation": [[5, 5, 13, 5, 13, 13, 5, 13]]}]})");
  const Opened opened(folder, "CocoReader");
  const StoredCapture stored = opened.read(0);
  CHECK(stored.capture.frames.at(0).instances.size() == 2);
  CHECK_FALSE(stored.capture.frames.at(0).has(kInstanceId.name));
  REQUIRE(stored.masks.size() == 1);
  REQUIRE(stored.masks[0].size() == 2);
  for (const auto& [id, box] :
       {std::pair(1U, PixelBox{1, 1, 9, 9}), {2U, PixelBox{5, 5, 13, 13}}}) {
    const CoverageMask& mask = stored.masks[0].at(id);
    CHECK(mask.extent() == box);
    CHECK(std::ranges::count(mask.bits, 1) == 64);
  }
  CHECK(opened.dataset->read(0, {std::string(kHoldsTightBoxes)}).masks.empty());
}

TEST_CASE("COCO boxes without masks, whose lists are empty, are no picture of ids", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("train/a.png", picture(20, 20, 9, ImageFormat::Png));
  folder.write("train/_annotations.coco.json", R"({"images": [{"id": 0, "file_name": "a.png",
    "width": 20, "height": 20}], "categories": [{"id": 1, "name": "box"}], "annotations": [
    {"id": 0, "image_id": 0, "category_id": 1, "bbox": [1, 1, 8, 8], "segmentation": []}]})");
  const Opened opened(folder, "CocoReader");
  CHECK(opened.read(0).capture.frames.at(0).instances.size() == 1);
  CHECK_FALSE(opened.holds(kInstanceId.name));
}

TEST_CASE("MOT sequences whose pictures have eight digits and whose tracks count from 0",
          "[readers]") {
  const test::TemporaryFolder folder;
  const std::string sequence = "val/dancetrack0004/";
  folder.write(sequence + "img1/00000001.jpg", picture(40, 30, 90, ImageFormat::Jpeg));
  folder.write(sequence + "img1/00000002.jpg", picture(40, 30, 30, ImageFormat::Jpeg));
  folder.write(sequence + "seqinfo.ini",
               "[Sequence]\nname=dancetrack0004\nimDir=img1\nframeRate=20\nseqLength=2\n"
               "imWidth=40\nimHeight=30\nimExt=.jpg\n");
  folder.write(sequence + "gt/gt.txt",
               "1,0,3,4,8,12,1,1,1\n2,0,4,4,8,12,1,1,1\n2,1,20,4,8,12,1,1,1\n");
  const Opened opened(folder, "MotReader");
  REQUIRE(opened.dataset->info().captures.size() == 2);
  CHECK(opened.read(0).capture.frames.at(0).has(kColor.name));
  const StoredCapture second = opened.read(1);
  const Frame& last = second.capture.frames.at(0);
  REQUIRE(last.instances.size() == 2);
  CHECK(last.instances[0].id == opened.read(0).capture.frames.at(0).instances.at(0).id);
  CHECK(last.instances[0].id != last.instances[1].id);
}

TEST_CASE("Faults of a foreign COCO file are told with what they are about", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("images/a.png", picture(20, 20, 9, ImageFormat::Png));
  folder.write("annotations/instances_train.json", R"({"images": [
    {"id": 1, "file_name": "a.png", "width": 20, "height": 20},
    {"id": 2, "file_name": "gone.png", "width": 20, "height": 20},
    {"id": 3, "file_name": "../../etc/passwd", "width": 20, "height": 20},
    {"id": 4, "file_name": "huge.png", "width": 2000000000, "height": 2000000000}],
    "categories": [{"id": 1, "name": "box"}], "annotations": [
    {"id": 1, "image_id": 1, "category_id": 7, "bbox": [1, 1, 8, 8]},
    {"id": 1, "image_id": 1, "category_id": 1, "bbox": [15, 15, 80, 8]},
    {"id": 5, "image_id": 77, "category_id": 1, "bbox": [1, 1, 8, 8]},
    {"id": 6, "image_id": 1, "category_id": 1, "bbox": [1, 1, 2, 2],
     "segmentation": {"size": [20, 20], "counts": [9000000000000000000, 5]}}]})");
  const LintReport report = lint(folder);
  CHECK(finds(report, "ids within the label map", "instances_train.json"));
  CHECK(finds(report, "nothing is there twice", "instances_train.json"));
  CHECK(finds(report, "labels lie in the image", "instances_train.json"));
  CHECK(finds(report, "nothing is missing", "gone.png"));
  CHECK(finds(report, "every file can be read", "instances_train.json"));
  CHECK(finds(report, "counts agree between files", "instances_train.json"));
  const auto category =
      std::ranges::find(report.findings, "ids within the label map", &LintFinding::check);
  REQUIRE(category != report.findings.end());
  CHECK(category->object == "annotation 1");
  CHECK(category->capture == 0);
  CHECK(category->message == "capture 0, camera, annotation 1: has the unknown category 7");
  const auto outside = std::ranges::any_of(report.findings, [](const LintFinding& finding) {
    return finding.message.find("'../../etc/passwd' lies outside of the dataset") !=
           std::string::npos;
  });
  CHECK(outside);
}

TEST_CASE("YOLO without a path, with lists, comments and pictures without labels", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("train/images/b.jpg", picture(40, 20, 50, ImageFormat::Jpeg));
  folder.write("train/images/a.jpg", picture(40, 20, 60, ImageFormat::Jpeg));
  folder.write("valid/images/c.png", picture(40, 20, 70, ImageFormat::Png));
  folder.write("train/labels/a.txt", "1 0.5 0.5 0.25 0.5\r\n0 0.1 0.2 0.1 0.2");
  folder.write("valid/labels/c.txt", "");
  folder.write("data.yaml",
               "train: ../train/images  # where the exporter had it\n"
               "val: ../valid/images\ntest: ../test/images\n\nnc: 2\n"
               "names: ['mug, blue', \"b\\u00e4r\"]\n"
               "roboflow:\n  workspace: none\n  version: 3\n");
  const Opened opened(folder, "YoloReader");
  CHECK(opened.dataset->info().classes == std::vector<std::string>{"mug, blue", "bär"});
  REQUIRE(opened.dataset->info().captures.size() == 3);
  const StoredCapture a = opened.read(0);
  CHECK(a.split == "train");
  const Frame& frame = a.capture.frames.at(0);
  REQUIRE(frame.instances.size() == 2);
  CHECK(frame.instances[0].labels.at("class") == "bär");
  CHECK(*frame.instances[0].tight_box == PixelBox{15, 5, 25, 15});
  CHECK(opened.read(1).capture.frames.at(0).instances.empty());
  CHECK(opened.read(2).split == "val");
}

TEST_CASE("YOLO polygons and block-style names; a line in two is found", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("images/train/a.png", picture(40, 20, 50, ImageFormat::Png));
  folder.write("labels/train/a.txt",
               "0 0.1 0.1 0.5 0.1 0.5 0.5 0.1 0.5\n1 0.6 0.5 0.9 0.5 0.75 0.9\n");
  folder.write("data.yaml",
               "path: /home/somebody/datasets/shapes\ntrain: images/train\nval: images/train\n"
               "names:\n  0: square\n  1: wedge\n");
  const Opened opened(folder, "YoloReader");
  const StoredCapture stored = opened.read(0);
  const Frame& frame = stored.capture.frames.at(0);
  REQUIRE(frame.has(kInstanceId.name));
  CHECK(*frame.instances[0].tight_box == PixelBox{4, 2, 20, 10});
  CHECK(std::ranges::count(frame.get(kInstanceId).pixels(), frame.instances[0].id) == 16 * 8);

  folder.write("labels/train/a.txt",
               "0 0.1 0.1 0.5 0.1 0.5 0.5\n0 0.1 0.1 0.5 0.1 0.5 0.5\n"
               "3 0.1 nan 0.5 0.1 0.5 0.5\n4 0.1 0.1 0.5\n");
  const LintReport report = lint(folder);
  CHECK(finds(report, "nothing is there twice", "labels/train/a.txt"));
  CHECK(finds(report, "every file can be read", "labels/train/a.txt"));
  CHECK(finds(report, "ids within the label map", "labels/train/a.txt"));
}

TEST_CASE("COCO whose pictures were elsewhere: drives, folders of others, a mark in front",
          "[readers]") {
  const test::TemporaryFolder folder;
  const auto page = [](const std::string& file) {
    return "\xEF\xBB\xBF{\"images\": [{\"id\": 9007199254740993, \"file_name\": \"" + file +
           "\", \"width\": 40, \"height\": 30}], \"categories\": [{\"id\": 0, \"name\": \"cup\"}], "
           "\"annotations\": [{\"id\": 1, \"image_id\": 9007199254740993, \"category_id\": 0.0, "
           "\"bbox\": [3, 4, 10, 12]}]}\r\n";
  };
  folder.write("data/sub/1.png", picture(40, 30, 90, ImageFormat::Png));
  for (const char* name : {"sub/1.png", "sub\\\\1.png", "D:\\\\old\\\\data\\\\sub\\\\1.png",
                           "/mnt/somewhere/data/sub/1.png", "../data/sub/1.png"}) {
    INFO(name);
    folder.write("labels.json", page(name));
    const Opened opened(folder, "CocoReader");
    const StoredCapture stored = opened.read(0);
    const Frame& frame = stored.capture.frames.at(0);
    REQUIRE(frame.has(kColor.name));
    REQUIRE(frame.instances.size() == 1);
    CHECK(*frame.instances[0].tight_box == PixelBox{3, 4, 13, 16});
    CHECK(frame.instances[0].labels.at("class") == "cup");
  }
  folder.write("labels.json", page("/etc/passwd"));
  CHECK(finds(lint(folder), "every file can be read", "labels.json"));
  CHECK(possible_places("..\\a/./b") == std::vector<std::string>{"a/b", "b"});
  CHECK(possible_places("/").empty());
  CHECK(possible_places("a/../b/..").empty());
}

TEST_CASE("YOLO by any page's name, with labels beside pictures, and by lists", "[readers]") {
  const std::string label = "\xEF\xBB\xBF" + std::string("1 0.5 0.5 0.25 0.5\r\n\r\n");
  const auto check = [](const test::TemporaryFolder& folder, const std::string& name) {
    const Opened opened(folder, "YoloReader");
    const StoredCapture stored = opened.read(0);
    const Frame& frame = stored.capture.frames.at(0);
    REQUIRE(frame.instances.size() == 1);
    CHECK(frame.instances[0].labels.at("class") == name);
    CHECK(*frame.instances[0].tight_box == PixelBox{15, 5, 25, 15});
    CHECK(opened.dataset->info().captures.size() == 1);
    return stored.split;
  };
  SECTION("a page of another name") {
    const test::TemporaryFolder folder;
    folder.write("images/train2017/1.JPG", picture(40, 20, 50, ImageFormat::Jpeg));
    folder.write("labels/train2017/1.txt", label);
    folder.write("hyp.yaml", "lr0: 0.01\n");
    folder.write("coco8.yaml",
                 "path: ../datasets/coco8 # root\r\ntrain: images/train2017\r\nval: "
                 "images/val2017\r\nnames:\r\n  0: person\r\n  1: \"hot dog\"\r\n");
    CHECK(check(folder, "hot dog") == "train");
  }
  SECTION("a labelling tool's folder") {
    const test::TemporaryFolder folder;
    folder.write("1.png", picture(40, 20, 50, ImageFormat::Png));
    folder.write("1.txt", label);
    folder.write("classes.txt", "cup\r\nplate\r\n");
    CHECK(check(folder, "plate").empty());
  }
  SECTION("Darknet's list") {
    const test::TemporaryFolder folder;
    folder.write("obj_train_data/1.png", picture(40, 20, 50, ImageFormat::Png));
    folder.write("obj_train_data/1.txt", label);
    folder.write("obj.names", "cup\nplate\n");
    folder.write("train.txt", "data/obj_train_data/1.png\n");
    CHECK(check(folder, "plate") == "train");
  }
  SECTION("a list with the paths of another machine") {
    const test::TemporaryFolder folder;
    folder.write("images/train/1.png", picture(40, 20, 50, ImageFormat::Png));
    folder.write("labels/train/1.txt", label);
    folder.write("train.txt", "/content/d/images/train/1.png\r\n");
    folder.write(
        "data.yaml",
        "train: /content/d/train.txt\nval: /content/d/train.txt\nnc: 2\nnames: [cup, plate]\n");
    CHECK(check(folder, "plate") == "train");
  }
  SECTION("texts beside pictures are no labels without a list of classes") {
    const test::TemporaryFolder folder;
    folder.write("1.png", picture(40, 20, 50, ImageFormat::Png));
    folder.write("1.txt", "a caption\n");
    test::EncodingHost host;
    CHECK(test::every_reader(host).recognise(folder.path("")) != "YoloReader");
  }
}

TEST_CASE("KITTI's own fifteen columns, DontCare, and a calibration with a shift", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("training/image_2/000007.png", picture(124, 38, 50, ImageFormat::Png));
  // A car 10 m ahead, in the space of camera 0; camera 2 lies 6 cm to its left.
  folder.write("training/calib/000007.txt",
               "P0: 70 0 60 0 0 70 18 0 0 0 1 0\nP1: 70 0 60 -27 0 70 18 0 0 0 1 0\n"
               "P2: 70 0 60 4.2 0 70 18 0 0 0 1 0\nP3: 70 0 60 -23 0 70 18 0 0 0 1 0\n"
               "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n");
  folder.write("training/label_2/000007.txt",
               "Car 0.00 0 -1.57 47.86 16.28 74.14 28.91 1.50 1.80 4.00 0.00 1.45 10.00 -1.57\n"
               "DontCare -1 -1 -10 3.00 4.00 9.00 9.50 -1 -1 -1 -1000 -1000 -1000 -10\n");
  const Opened opened(folder, "KittiReader");
  CHECK(opened.holds(kHoldsCamera));
  CHECK(opened.holds(kHoldsBoxes3d));
  CHECK_FALSE(opened.holds(kHoldsPoses));
  CHECK_FALSE(opened.holds(kHoldsCameraPose));
  const StoredCapture stored = opened.read(0);
  const Frame& frame = stored.capture.frames.at(0);
  CHECK(frame.camera.fx == 70.0);
  REQUIRE(frame.instances.size() == 1);
  const Instance& car = frame.instances[0];
  CHECK(car.labels.at("class") == "Car");
  CHECK(*car.tight_box == PixelBox{47, 16, 75, 29});
  // x right, y up, looking along -z; the origin is the middle of the bottom.
  const Vec3 place = car.world_from_node.translation();
  CHECK(place.x() == Approx(0.06));
  CHECK(place.y() == Approx(-1.45));
  CHECK(place.z() == Approx(-10.0));
  CHECK(car.bounds_node.size().isApprox(Vec3(4.0, 1.5, 1.8)));
  // The heading is away from the camera: its length lies along the axis.
  const Vec3 heading = car.world_from_node.linear().col(0);
  CHECK(std::abs(heading.z()) == Approx(1.0).margin(1e-3));

  // What is not known is said of all at once, and only of areas without labels by itself.
  const std::string box = " 47.86 16.28 74.14 28.91 ";
  const std::string nowhere = "-1 -1 -1 -1000 -1000 -1000 -10\n";
  folder.write("training/label_2/000007.txt",
               "Car -1 3 -10" + box + nowhere + "Van 0.00 0 0" + box + "0 0 0 0 0 0 0\n");
  CHECK(lint(folder).findings.empty());
  const std::string there = "1.50 1.80 4.00 0.00 1.45 10.00 ";
  for (const auto& [label, check] : std::vector<std::pair<std::string, const char*>>{
           {"Car -1 0 -1.57" + box + there + "-1.57\n", "visible <= amodal"},
           {"Car 0.00 0 -10" + box + there + "-1.57\n", "angles agree"},
           {"Car 0.00 0 -1.57" + box + there + "-10\n", "angles agree"},
           {"Car 0.00 0 -10" + box + "-1 -1 -1 0.00 1.45 10.00 -10\n", "angles agree"},
           {"Car 0.00 0 -1.57" + box + "-1 1.80 4.00 0.00 1.45 10.00 -1.57\n",
            "every file can be read"}}) {
    INFO(label);
    folder.write("training/label_2/000007.txt", label);
    CHECK(finds(lint(folder), check, "label_2/000007.txt"));
  }

  folder.write("training/label_2/000007.txt",
               "Car 0.00 7 2.0 47.86 16.28 74.14 28.91 1.50 1.80 4.00 0.00 1.45 10.00 -1.57\n"
               "Car 0 0 0 1 2 3\n");
  const LintReport report = lint(folder);
  CHECK(finds(report, "visible <= amodal", "label_2/000007.txt"));
  CHECK(finds(report, "angles agree", "label_2/000007.txt"));
  CHECK(finds(report, "every file can be read", "label_2/000007.txt"));
}

TEST_CASE("VOC by a labelling tool: attributes, parts, floats, a border in the masks",
          "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("JPEGImages/2007_000032.jpg", picture(12, 10, 50, ImageFormat::Jpeg));
  folder.write("Annotations/2007_000032.xml",
               "<?xml version=\"1.0\"?>\n<!-- by hand -->\n<annotation verified=\"yes\">"
               "<folder>VOC2007</folder><filename>2007_000032.jpg</filename>\n"
               "<size><width>12</width><height>10</height><depth>3</depth></size>"
               "<segmented>1</segmented>"
               "<object><name>cat &amp; dog</name><difficult>0</difficult><truncated>1</truncated>"
               "<bndbox><xmax>6.0</xmax><xmin>2.0</xmin><ymax>5</ymax><ymin>2</ymin></bndbox>"
               "<part><name>head</name><bndbox><xmin>1</xmin><ymin>1</ymin><xmax>2</xmax>"
               "<ymax>2</ymax></bndbox></part></object></annotation>");
  std::vector<std::uint8_t> mask(120, 0);
  for (int y = 1; y < 5; ++y) {
    for (int x = 1; x < 6; ++x) {
      const bool is_border = y == 1 || y == 4 || x == 1 || x == 5;
      mask[std::size_t(12 * y + x)] = is_border ? 255 : 1;
    }
  }
  folder.write("SegmentationObject/2007_000032.png", gray(12, 10, mask));
  folder.write("ImageSets/Main/train.txt", "2007_000032\n");
  folder.write("ImageSets/Main/cat_train.txt", "2007_000032 -1\n");
  const Opened opened(folder, "VocReader");
  const StoredCapture stored = opened.read(0);
  CHECK(stored.split == "train");
  const Frame& frame = stored.capture.frames.at(0);
  REQUIRE(frame.instances.size() == 1);
  CHECK(frame.instances[0].labels.at("class") == "cat & dog");
  CHECK(*frame.instances[0].tight_box == PixelBox{1, 1, 6, 5});
  CHECK(std::ranges::count(frame.get(kInstanceId).pixels(), 1u) == 6);

  for (const char* xml : {"", "<annotation>", "<a", "<annotation></annotation>",
                          "<annotation><size><width>x</width></size></annotation>"}) {
    folder.write("Annotations/2007_000032.xml", xml);
    CHECK(finds(lint(folder), "every file can be read", "2007_000032.xml"));
  }
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  folder.write("Annotations/2007_000032.xml", deep);
  CHECK(finds(lint(folder), "every file can be read", "2007_000032.xml"));
}

TEST_CASE("VOC of a labelling tool: beside its pictures, with a mark in front, without sizes",
          "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("1.png", picture(12, 10, 50, ImageFormat::Png));
  folder.write("1.xml",
               "\xEF\xBB\xBF<annotation><folder>me</folder><filename>1.png</filename>"
               "<path>C:\\Users\\me\\1.png</path><object><name>cup</name><bndbox><xmin>2</xmin>"
               "<ymin>3</ymin><xmax>9</xmax><ymax>8</ymax></bndbox></object></annotation>\r\n");
  const Opened opened(folder, "VocReader");
  const StoredCapture stored = opened.read(0);
  const Frame& frame = stored.capture.frames.at(0);
  CHECK(frame.camera.width == 12);
  CHECK(frame.has(kColor.name));
  REQUIRE(frame.instances.size() == 1);
  CHECK(*frame.instances[0].tight_box == PixelBox{1, 2, 9, 8});
}

TEST_CASE(
    "A Replicator folder with other product names, raw ids and nothing but pictures and boxes",
    "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("Replicator_01/rgb/rgb_0000.png", picture(8, 6, 50, ImageFormat::Png));
  std::vector<std::uint8_t> ids(48, 0);
  for (int y = 2; y < 4; ++y) {
    for (int x = 3; x < 6; ++x) ids[std::size_t(8 * y + x)] = 9;
  }
  folder.write("Replicator_01/instance_segmentation/instance_segmentation_0000.png",
               gray(8, 6, ids));
  folder.write("Replicator_01/instance_segmentation/instance_segmentation_mapping_0000.json",
               R"({"0": "BACKGROUND", "1": "UNLABELLED", "9": "/World/Cube"})");
  folder.write(
      "Replicator_01/instance_segmentation/instance_segmentation_semantics_mapping_0000.json",
      R"({"0": {"class": "BACKGROUND"}, "1": {"class": "UNLABELLED"}, "9": {"class": "cube"}})");
  const Opened opened(folder, "BasicReader");
  CHECK(opened.dataset->info().camera_names == std::vector<std::string>{"Replicator_01"});
  CHECK_FALSE(opened.holds(kHoldsTightBoxes));
  const StoredCapture stored = opened.read(0);
  const Frame& frame = stored.capture.frames.at(0);
  REQUIRE(frame.instances.size() == 1);
  CHECK(frame.instances[0].node_path == "/World/Cube");
  CHECK(frame.instances[0].labels.at("class") == "cube");
  CHECK(std::ranges::count(frame.get(kInstanceId).pixels(), frame.instances[0].id) == 6);
}

TEST_CASE("A Replicator folder of a version that names no nodes", "[readers]") {
  const test::TemporaryFolder folder;
  const auto table = [](const std::vector<std::array<std::int32_t, 5>>& rows) {
    std::string header =
        "{'descr': [('semanticId', '<u4'), ('x_min', '<i4'), ('y_min', '<i4'), ('x_max', '<i4'), "
        "('y_max', '<i4'), ('occlusionRatio', '<f4')], 'fortran_order': False, 'shape': (" +
        std::to_string(rows.size()) + ",), }";
    while ((header.size() + 11) % 64 != 0) header += ' ';
    header += '\n';
    std::string bytes("\x93NUMPY\x01\x00", 8);
    bytes += char(header.size() & 255);
    bytes += char(header.size() >> 8);
    bytes += header;
    for (const auto& row : rows) {
      const float ratio = 0.25f;
      bytes.append(reinterpret_cast<const char*>(row.data()), sizeof row);
      bytes.append(reinterpret_cast<const char*>(&ratio), sizeof ratio);
    }
    return bytes;
  };
  folder.write("rgb_0000.png", picture(40, 30, 50, ImageFormat::Png));
  folder.write("bounding_box_2d_tight_0000.npy", table({{0, 5, 6, 9, 11}, {1, 20, 4, 30, 8}}));
  folder.write("bounding_box_2d_tight_labels_0000.json",
               R"({"0": {"class": "cube"}, "1": {"class": "ball"}})");
  folder.write("bounding_box_2d_loose_0000.npy", table({{1, 20, 4, 30, 8}, {0, 5, 6, 9, 11}}));
  folder.write("bounding_box_2d_loose_labels_0000.json",
               R"({"0": {"class": "cube"}, "1": {"class": "ball"}})");
  folder.write("rgb_0001.png", picture(40, 30, 51, ImageFormat::Png));
  for (const char* kind : {"tight", "loose"}) {
    const std::string front = std::string("bounding_box_2d_") + kind;
    folder.write(front + "_0001.npy", table({}));
    folder.write(front + "_labels_0001.json", "{}");
  }
  const Opened opened(folder, "BasicReader");
  CHECK_FALSE(opened.holds(kHoldsNodePaths));
  const StoredCapture stored = opened.read(0);
  const Frame& frame = stored.capture.frames.at(0);
  REQUIRE(frame.instances.size() == 2);
  CHECK(frame.instances[0].labels.at("class") == "cube");
  CHECK(*frame.instances[0].tight_box == PixelBox{5, 6, 10, 12});
  CHECK(frame.instances[0].id != frame.instances[1].id);
  CHECK(opened.read(1).capture.frames.at(0).instances.empty());
}
