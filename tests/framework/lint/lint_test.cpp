// SPDX-License-Identifier: Apache-2.0
// Writes real datasets to disk, lints them, then breaks them in one way each and lints again.
#include "framework/lint/lint_dataset.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <sstream>

#include "framework/app/command_lint.h"
#include "framework/lint/dataset_on_disk.h"
#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_basic/basic_writer.h"
#include "writer_bop/bop_writer.h"
#include "writer_coco/coco_writer.h"
#include "writer_kitti/kitti_writer.h"
#include "writer_pose/pose_writer.h"

using namespace diorama;
using test::DatasetOnDisk;
using test::everything;

namespace {

template <class W>
DatasetOnDisk dataset_of(typename W::Params params = {}) {
  test::EncodingHost host;
  return DatasetOnDisk(test::write_sample<W>(std::move(params), host));
}

DatasetOnDisk basic_dataset() { return dataset_of<BasicWriter>(everything()); }

bool finds(const LintReport& report, const std::string& check, const std::string& file) {
  return std::ranges::any_of(report.findings, [&](const LintFinding& finding) {
    return finding.check == check && finding.file.find(file) != std::string::npos;
  });
}

}  // namespace

TEST_CASE("what the writers write is found good", "[lint]") {
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  test::EncodingHost host;
  for (const test::SampleFormat& format : test::every_format()) {
    const DatasetOnDisk dataset(
        format.write(host, test::sample_dataset(test::SampleScene(8, 6)), captures));
    const LintReport report = dataset.lint();
    INFO(format.name << " " << lint_text(report, 20));
    CHECK(report.findings.empty());
    CHECK(report.checks > 10);
  }
}

TEST_CASE("swapped numbers in an array are found", "[lint]") {
  const auto basic = basic_dataset();
  const std::string file = "rp_cam_0/bounding_box_3d/bounding_box_3d_0000.npy";
  // x and y of the first box's place.
  const std::size_t place = 320 + 28 + 48;
  const float x = basic.peek<float>(file, place);
  const float y = basic.peek<float>(file, place + 4);
  basic.poke(file, place, y);
  basic.poke(file, place + 4, x);
  CHECK(finds(basic.lint(), "pose and camera reproject onto the mask", file));
  CHECK(finds(basic.lint(), "depth back-projects", "rp_cam_0"));
}

TEST_CASE("a missing file is named once", "[lint]") {
  const auto basic = basic_dataset();
  basic.remove("rp_cam_1/distance_to_camera/distance_to_camera_0002.npy");
  const LintReport report = basic.lint();
  REQUIRE(report.findings.size() == 1);
  CHECK(report.findings[0].check == "nothing is missing");
  CHECK(report.findings[0].file == "rp_cam_1/distance_to_camera/distance_to_camera_0002.npy");
  CHECK(report.findings[0].message ==
        "capture 2, cam_1: the file is not there; right would be: other frames have "
        "distance_to_camera.npy");
}

TEST_CASE("the wrong kind of depth is found, with and without the other kind", "[lint]") {
  const auto both = basic_dataset();
  const std::string plane = "rp_cam_0/distance_to_image_plane/distance_to_image_plane_0000.npy";
  both.write("rp_cam_0/distance_to_camera/distance_to_camera_0000.npy", both.read(plane));
  CHECK(finds(both.lint(), "depth back-projects", "distance_to_camera_0000.npy"));

  BasicWriter::Params params = everything();
  params.distance_to_image_plane = false;
  const auto one = dataset_of<BasicWriter>(params);
  one.write("rp_cam_0/distance_to_camera/distance_to_camera_0000.npy", both.read(plane));
  CHECK(finds(one.lint(), "depth back-projects", "distance_to_camera_0000.npy"));
}

TEST_CASE("the reference's swapped product is right where all files have it, a fault in one",
          "[lint]") {
  for (const char* layout : {"none", "dope", "centerpose"}) {
    INFO(layout);
    PoseWriter::Params params;
    params.format = layout;
    const auto right = dataset_of<PoseWriter>(params);
    CHECK(right.lint().findings.empty());
    params.compat = "replicator";
    const auto swapped = dataset_of<PoseWriter>(params);
    const LintReport report = swapped.lint();
    INFO(lint_text(report, 20));
    CHECK(report.findings.empty());
    right.write("000002.json", swapped.read("000002.json"));
    CHECK(finds(right.lint(), "pose agrees with the keypoints", "000002.json"));
  }
}

TEST_CASE("ids without an entry and overlapping masks are found", "[lint]") {
  const auto basic = basic_dataset();
  const std::string labels =
      "rp_cam_0/semantic_segmentation/semantic_segmentation_labels_0000.json";
  basic.replace(labels, "(93, ", "(94, ");
  CHECK(finds(basic.lint(), "ids within the label map", "semantic_segmentation_0000.png"));

  const auto coco = dataset_of<CocoWriter>();
  std::string json = coco.read("annotations/instances_train.json");
  const std::size_t first = json.find("\"segmentation\": {");
  const std::size_t end = json.find('}', first);
  const std::string mask = json.substr(first, end - first);
  const std::size_t node = json.find("\"bbox\"", end + 1);
  const std::size_t second = json.find("\"segmentation\": {", node);
  json.replace(second, json.find('}', second) - second, mask);
  coco.write("annotations/instances_train.json", json);
  CHECK_FALSE(coco.lint().findings.empty());
}

TEST_CASE("pictures of a foreign size are found, not read beyond their end", "[lint]") {
  const auto basic = basic_dataset();
  // cam_1 has fewer columns.
  basic.write("rp_cam_0/instance_segmentation/instance_segmentation_0000.png",
              basic.read("rp_cam_1/instance_segmentation/instance_segmentation_0000.png"));
  CHECK(finds(basic.lint(), "counts agree between files", "instance_segmentation_0000.png"));
  const auto kitti = dataset_of<KittiWriter>();
  kitti.write("training/depth_2/000000.png", kitti.read("training/depth_2/000001.png"));
  CHECK(finds(kitti.lint(), "counts agree between files", "depth_2/000000.png"));
  const auto bop = dataset_of<BopWriter>();
  for (const char* split : {"train_pbr", "test"}) {
    const std::string scenes = std::string(split) + "/";
    if (!std::filesystem::exists(bop.folder() / (scenes + "000000/depth/000000.png"))) continue;
    bop.write(scenes + "000000/depth/000000.png", bop.read(scenes + "000001/depth/000000.png"));
  }
  CHECK(finds(bop.lint(), "counts agree between files", "depth/000000.png"));
}

TEST_CASE("a folder of several datasets is linted in one go, others are refused", "[lint]") {
  const auto pose = dataset_of<PoseWriter>();
  const std::filesystem::path outer = pose.folder().string() + "_outer";
  std::filesystem::create_directories(outer / "not_a_dataset");
  std::filesystem::copy(pose.folder(), outer / "poses", std::filesystem::copy_options::recursive);
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  const auto reports = lint_datasets(outer, readers, host);
  REQUIRE(reports.size() == 1);
  CHECK(reports[0].format == "PoseWriter");
  CHECK(lint_json(reports).find("\"findings\": []") != std::string::npos);
  std::filesystem::remove_all(outer / "poses");
  CHECK_THROWS_WITH(lint_datasets(outer, readers, host), ContainsSubstring("holds no dataset"));
  CHECK_THROWS_WITH(lint_datasets(outer / "absent", readers, host),
                    ContainsSubstring("not a folder"));
  std::filesystem::remove_all(outer);
}

TEST_CASE("the command's exit code tells clean from faulty", "[lint]") {
  const auto pose = dataset_of<PoseWriter>();
  std::ostringstream text;
  std::streambuf* const before = std::cout.rdbuf(text.rdbuf());
  const int clean = print_lint({pose.lint()}, false);
  pose.remove("000000.png");
  const int faulty = print_lint({pose.lint()}, true);
  std::cout.rdbuf(before);
  CHECK(clean == 0);
  CHECK(faulty == 7);
  CHECK(text.str().find("nothing found") != std::string::npos);
  CHECK(text.str().find("\"check\": \"nothing is missing\"") != std::string::npos);
}
