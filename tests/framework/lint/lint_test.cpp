// SPDX-License-Identifier: Apache-2.0
// Writes real datasets to disk, lints them, then breaks them in one way each and lints again.
#include "framework/lint/lint_dataset.h"

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <sstream>

#include "framework/app/command_lint.h"
#include "framework/lint/encoding_host.h"
#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_basic/basic_writer.h"
#include "writer_bop/bop_writer.h"
#include "writer_coco/coco_writer.h"
#include "writer_hdf5/hdf5_writer.h"
#include "writer_kitti/kitti_writer.h"
#include "writer_pose/pose_writer.h"
#include "writer_voc/voc_writer.h"
#include "writer_webdataset/webdataset_writer.h"
#include "writer_yolo/yolo_writer.h"

using namespace diorama;

namespace {

/// A dataset on disk that is removed with the object.
class DatasetOnDisk {
 public:
  explicit DatasetOnDisk(const test::MemoryFiles& files)
      : folder_(std::filesystem::temp_directory_path() /
                ("diorama_lint_" + std::to_string(getpid()) + "_" +
                 std::to_string(reinterpret_cast<std::uintptr_t>(this)))) {
    for (const auto& [path, bytes] : files.files) {
      std::filesystem::create_directories((folder_ / path).parent_path());
      write(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    }
  }
  ~DatasetOnDisk() { std::filesystem::remove_all(folder_); }

  std::string read(const std::string& path) const {
    std::ifstream in(folder_ / path, std::ios::binary);
    REQUIRE(in);
    std::ostringstream text;
    text << in.rdbuf();
    return std::move(text).str();
  }
  void write(const std::string& path, const std::string& text) const {
    std::ofstream(folder_ / path, std::ios::binary) << text;
  }
  void remove(const std::string& path) const { REQUIRE(std::filesystem::remove(folder_ / path)); }
  void truncate(const std::string& path) const {
    std::filesystem::resize_file(folder_ / path, std::filesystem::file_size(folder_ / path) / 2);
  }
  void replace(const std::string& path, const std::string& from, const std::string& to) const {
    std::string text = read(path);
    const std::size_t at = text.find(from);
    REQUIRE(at != std::string::npos);
    write(path, text.replace(at, from.size(), to));
  }
  /// Changes one number of a binary file.
  template <class T>
  void poke(const std::string& path, std::size_t offset, T value) const {
    std::string text = read(path);
    REQUIRE(offset + sizeof value <= text.size());
    std::memcpy(text.data() + offset, &value, sizeof value);
    write(path, text);
  }
  template <class T>
  T peek(const std::string& path, std::size_t offset) const {
    const std::string text = read(path);
    T value{};
    std::memcpy(&value, text.data() + offset, sizeof value);
    return value;
  }

  LintReport lint() const {
    const auto reports = lint_datasets(folder_);
    REQUIRE(reports.size() == 1);
    return reports[0];
  }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

template <class W>
DatasetOnDisk dataset_of(typename W::Params params = {}) {
  test::EncodingHost host;
  return DatasetOnDisk(test::write_sample<W>(std::move(params), host));
}

BasicWriter::Params everything() {
  BasicWriter::Params p;
  p.rgb = p.bounding_box_2d_tight = p.bounding_box_2d_loose = p.semantic_segmentation = true;
  p.instance_id_segmentation = p.instance_segmentation = p.distance_to_camera = true;
  p.distance_to_image_plane = p.bounding_box_3d = p.occlusion = p.normals = true;
  p.motion_vectors = p.camera_params = p.pointcloud = true;
  return p;
}

DatasetOnDisk basic_dataset() { return dataset_of<BasicWriter>(everything()); }

bool finds(const LintReport& report, const std::string& check, const std::string& file) {
  return std::ranges::any_of(report.findings, [&](const LintFinding& finding) {
    return finding.check == check && finding.file.find(file) != std::string::npos;
  });
}

void require_clean(const DatasetOnDisk& dataset) {
  const LintReport report = dataset.lint();
  INFO(lint_text(report, 20));
  CHECK(report.findings.empty());
  CHECK(report.checks > 10);
}

}  // namespace

TEST_CASE("what the writers write is found good", "[lint]") {
  require_clean(basic_dataset());
  BasicWriter::Params raw = everything();
  raw.use_common_output_dir = true;
  raw.colorize_semantic_segmentation = raw.colorize_instance_segmentation = false;
  raw.colorize_instance_id_segmentation = false;
  require_clean(dataset_of<BasicWriter>(raw));
  require_clean(dataset_of<PoseWriter>());
  PoseWriter::Params centre_pose;
  centre_pose.format = "centerpose";
  require_clean(dataset_of<PoseWriter>(centre_pose));
  require_clean(dataset_of<CocoWriter>());
  for (const char* task : {"detect", "segment", "pose", "obb"}) {
    YoloWriter::Params yolo;
    yolo.task = task;
    require_clean(dataset_of<YoloWriter>(yolo));
  }
  require_clean(dataset_of<KittiWriter>());
  require_clean(dataset_of<VocWriter>());
  require_clean(dataset_of<BopWriter>());
  require_clean(dataset_of<WebDatasetWriter>());
  CHECK(dataset_of<Hdf5Writer>().lint().findings.empty());
}

TEST_CASE("a shifted box is found", "[lint]") {
  const auto basic = basic_dataset();
  const std::string tight = "rp_cam_1/bounding_box_2d_tight/bounding_box_2d_tight_0001.npy";
  basic.poke<std::int32_t>(tight, 256 + 4, basic.peek<std::int32_t>(tight, 256 + 4) + 1);
  CHECK(finds(basic.lint(), "box = extent of mask", tight));

  const auto coco = dataset_of<CocoWriter>();
  std::string json = coco.read("annotations/instances_train.json");
  const std::size_t at = json.find("\"bbox\": [") + 9;
  json.insert(at, "1");
  coco.write("annotations/instances_train.json", json);
  CHECK(finds(coco.lint(), "box = extent of mask", "instances_train.json"));

  const auto voc = dataset_of<VocWriter>();
  voc.replace("Annotations/000000_cam_0.xml", "<xmin>", "<xmin>1");
  CHECK(finds(voc.lint(), "box = extent of mask", "000000_cam_0.xml"));
}

TEST_CASE("a swapped, shifted or mirrored axis of a pose is found", "[lint]") {
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

  const auto bop = dataset_of<BopWriter>();
  const std::string gt = "train_pbr/000000/scene_gt.json";
  std::string json = bop.read(gt);
  const std::size_t begin = json.find_first_of("-0123456789", json.find("\"cam_t_m2c\": [") + 13);
  const std::size_t end = json.find(',', begin);
  const double x_mm = std::stod(json.substr(begin, end - begin));
  bop.write(gt, json.replace(begin, end - begin, std::to_string(x_mm + 300.0)));
  CHECK(finds(bop.lint(), "pose and camera reproject onto the mask", "train_pbr/000000"));
  CHECK(finds(bop.lint(), "depth back-projects", "train_pbr/000000"));

  const auto kitti = dataset_of<KittiWriter>();
  std::istringstream labels(kitti.read("training/label_2/000000.txt"));
  std::vector<std::string> words{std::istream_iterator<std::string>(labels), {}};
  REQUIRE(words.size() % 15 == 0);
  words[11] = std::to_string(-std::stod(words[11]));
  std::string line;
  for (std::size_t i = 0; i < 15; ++i) line += words[i] + " ";
  kitti.write("training/label_2/000000.txt", line + "\n");
  CHECK(finds(kitti.lint(), "pose and camera reproject onto the mask", "label_2/000000.txt"));
}

TEST_CASE("a missing file is found", "[lint]") {
  const auto basic = basic_dataset();
  basic.remove("rp_cam_1/distance_to_camera/distance_to_camera_0002.npy");
  const LintReport report = basic.lint();
  REQUIRE(report.findings.size() == 1);
  CHECK(report.findings[0].check == "nothing is missing");
  CHECK(report.findings[0].message.find("distance_to_camera.npy of frame 0002") !=
        std::string::npos);

  const auto pose = dataset_of<PoseWriter>();
  pose.remove("000003.png");
  CHECK(finds(pose.lint(), "nothing is missing", "000003.json"));
  const auto yolo = dataset_of<YoloWriter>();
  for (const char* split : {"train", "val"}) {
    const std::string label = std::string("labels/") + split + "/000001_cam_0.txt";
    if (std::filesystem::exists(yolo.folder() / label)) yolo.remove(label);
  }
  CHECK(finds(yolo.lint(), "nothing is missing", "000001_cam_0.txt"));
  const auto kitti = dataset_of<KittiWriter>();
  kitti.remove("training/calib/000004.txt");
  CHECK(finds(kitti.lint(), "nothing is missing", "000004.txt"));
}

TEST_CASE("truncated files are found", "[lint]") {
  const auto basic = basic_dataset();
  basic.truncate("rp_cam_0/rgb/rgb_0001.png");
  basic.truncate("rp_cam_0/occlusion/occlusion_0000.npy");
  basic.truncate("rp_cam_1/camera_params/camera_params_0002.json");
  const LintReport report = basic.lint();
  CHECK(finds(report, "every file can be read", "rgb_0001.png"));
  CHECK(finds(report, "every file can be read", "occlusion_0000.npy"));
  CHECK(finds(report, "every file can be read", "camera_params_0002.json"));

  const auto tar = dataset_of<WebDatasetWriter>();
  tar.truncate("shards/000001.tar");
  CHECK(finds(tar.lint(), "every file can be read", "000001.tar"));
  const auto hdf5 = dataset_of<Hdf5Writer>();
  for (const char* split : {"train", "val"}) {
    const std::string file = std::string(split) + "/000002_cam_1.hdf5";
    if (std::filesystem::exists(hdf5.folder() / file)) hdf5.truncate(file);
  }
  CHECK(finds(hdf5.lint(), "every file can be read", "000002_cam_1.hdf5"));
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

TEST_CASE("the wrong quaternion order and the reference's swapped product are found", "[lint]") {
  const auto pose = dataset_of<PoseWriter>();
  std::string json = pose.read("000000.json");
  const std::size_t begin = json.find("\"quat_wxyz_camera_frame\": [") + 27;
  const std::size_t end = json.find(']', begin);
  std::string list = json.substr(begin, end - begin);
  const std::size_t comma = list.find(',');
  const std::string w = list.substr(0, comma);
  list = list.substr(comma + 1) + "," + w;
  pose.write("000000.json", json.replace(begin, end - begin, list));
  CHECK(finds(pose.lint(), "pose agrees with the keypoints", "000000.json"));

  PoseWriter::Params params;
  params.compat = "replicator";
  CHECK(finds(dataset_of<PoseWriter>(params).lint(), "pose agrees with the keypoints",
              "000000.json"));
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
  CHECK(finds(bop.lint(), "counts agree between files", "mask_visib"));
}

TEST_CASE("a folder of several datasets is linted in one go, others are refused", "[lint]") {
  const auto pose = dataset_of<PoseWriter>();
  const std::filesystem::path outer = pose.folder().string() + "_outer";
  std::filesystem::create_directories(outer / "not_a_dataset");
  std::filesystem::copy(pose.folder(), outer / "poses", std::filesystem::copy_options::recursive);
  const auto reports = lint_datasets(outer);
  REQUIRE(reports.size() == 1);
  CHECK(reports[0].format == "PoseWriter");
  CHECK(lint_json(reports).find("\"findings\": []") != std::string::npos);
  std::filesystem::remove_all(outer / "poses");
  CHECK_THROWS_WITH(lint_datasets(outer), ContainsSubstring("holds no dataset"));
  CHECK_THROWS_WITH(lint_datasets(outer / "absent"), ContainsSubstring("not a folder"));
  std::filesystem::remove_all(outer);
}

TEST_CASE("the command's exit code tells clean from faulty", "[lint]") {
  const auto pose = dataset_of<PoseWriter>();
  std::ostringstream text;
  std::streambuf* const before = std::cout.rdbuf(text.rdbuf());
  const int clean = command_lint({pose.folder().string(), false});
  pose.remove("000000.png");
  const int faulty = command_lint({pose.folder().string(), true});
  std::cout.rdbuf(before);
  CHECK(clean == 0);
  CHECK(faulty == 7);
  CHECK(text.str().find("nothing found") != std::string::npos);
  CHECK(text.str().find("\"check\": \"nothing is missing\"") != std::string::npos);
}
