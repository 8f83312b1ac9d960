// SPDX-License-Identifier: Apache-2.0
// HDF5, tar, BOP and image folders of other people: of h5py and tarfile, and by hand.
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>

#include "framework/datasets/opened_dataset.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "writer_hdf5/hdf5_view.h"

using namespace diorama;
using test::lint;
using Opened = test::OpenedDataset;

namespace {

/// False where the libraries are absent.
bool make(const std::string& kind, const test::TemporaryFolder& folder) {
  const std::string command = std::string("/usr/bin/python3 '") + DIORAMA_SOURCE_DIR +
                              "/tests/framework/datasets/make_foreign.py' " + kind + " '" +
                              folder.path("") + "'";
  const int status = std::system(command.c_str());
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  if (code == 77 || code == 127) {
    WARN("python3-h5py and python3-numpy are absent: " << kind << " is not tried");
    return false;
  }
  REQUIRE(code == 0);
  return true;
}

std::string png_of(int width, int height, int channels, const std::vector<std::uint8_t>& samples) {
  return test::encoded({samples.data(), width, height, channels, 8});
}

/// Another one for each shade.
std::string colors(int width, int height, int shade = 0) {
  std::vector<std::uint8_t> samples(std::size_t(width) * std::size_t(height) * 3);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = std::uint8_t((i + std::size_t(shade)) % 251);
  }
  return png_of(width, height, 3, samples);
}

std::string mask(int width, int height, const PixelBox& box) {
  std::vector<std::uint8_t> samples(std::size_t(width) * std::size_t(height), 0);
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) samples[std::size_t(y * width + x)] = 255;
  }
  return png_of(width, height, 1, samples);
}

std::string depth(int width, int height, std::uint16_t value) {
  const std::vector<std::uint16_t> samples(std::size_t(width) * std::size_t(height), value);
  return test::encoded({samples.data(), width, height, 1, 16});
}

bool finds_message(const LintReport& report, const std::string& check, const std::string& message) {
  return std::ranges::any_of(report.findings, [&](const LintFinding& finding) {
    return finding.check == check &&
           (finding.file + ": " + finding.message).find(message) != std::string::npos;
  });
}

std::string content(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return std::move(text).str();
}

}  // namespace

TEST_CASE("HDF5 of h5py: packed, shuffled, in chunks, of both byte orders and both versions",
          "[readers]") {
  const test::TemporaryFolder folder;
  if (!make("hdf5", folder)) return;
  const Opened opened(folder, "Hdf5Reader");
  REQUIRE(opened.dataset->info().captures.size() == 7);
  CHECK(opened.holds(kHoldsCamera));
  CHECK(opened.holds(kHoldsCameraPose));
  CHECK(opened.holds(kDistanceToImagePlane.name));
  CHECK_FALSE(opened.holds(kHoldsPoses));
  CHECK_FALSE(opened.holds(kHoldsNodePaths));
  std::vector<std::string> files;
  for (std::size_t i = 0; i < 7; ++i) {
    const StoredCapture stored = opened.read(i);
    REQUIRE(stored.capture.frames.size() == 1);
    files.push_back(stored.files[0].at(std::string(kColor.name)));
    INFO(files.back());
    const Frame& frame = stored.capture.frames[0];
    CHECK(frame.camera.width == 44);
    CHECK(frame.camera.height == 30);
    CHECK(frame.camera.cx == Approx(22.0));
    CHECK(frame.camera.fy == Approx(52.0));
    CHECK(frame.world_from_camera.translation() == Vec3(0.5, -3.0, 1.0));
    REQUIRE(frame.instances.size() == 2);
    CHECK(frame.instances[0].labels.at("class") == "3");
    CHECK(frame.instances[1].labels.at("class") == "box");
    CHECK(*frame.instances[1].tight_box == PixelBox{25, 10, 40, 25});
    CHECK(frame.get(kInstanceId).at(39, 24) == 7);
    CHECK(frame.get(kDistanceToImagePlane).at(6, 4) == 1.5f);
    CHECK(frame.get(kDistanceToImagePlane).at(0, 0) == std::numeric_limits<float>::infinity());
    // Towards a camera that looks along y.
    CHECK((frame.get(kNormals).at(7, 5) - Vec3f(0.0f, -1.0f, 0.0f)).norm() < 1e-6f);
  }
  CHECK(files == std::vector<std::string>{"0.hdf5", "5.hdf5", "10.hdf5", "15.hdf5", "20.hdf5",
                                          "25.hdf5", "30.hdf5"});
}

TEST_CASE("Chunks of HDF5 come together whatever their extents", "[readers]") {
  const test::TemporaryFolder folder;
  if (!make("pieces", folder)) return;
  std::string expected(7 * 11 * 3 * 2, '\0');
  for (std::size_t i = 0; i < expected.size() / 2; ++i) {
    const auto value = std::uint16_t(i);
    std::memcpy(expected.data() + 2 * i, &value, 2);
  }
  const Hdf5View view(content(folder.path("pieces.h5")));
  CHECK(view.read("three").data == expected);
  CHECK(view.shape("three") == std::vector<std::size_t>{7, 11, 3});
  CHECK(view.read("one").data == expected);
  CHECK(view.read("empty").data.empty());
  CHECK(view.read("never").data == std::string(5 * 6 * 4, '\0'));
  CHECK_THROWS_WITH(view.read("absent"), "has no data set 'absent'");
  CHECK_THROWS_WITH(view.text("one"), "is no single text");
  const Hdf5View latest(content(folder.path("latest.h5")));
  for (const char* name : {"three", "one", "single"}) {
    INFO(name);
    CHECK(latest.read(name).data == expected);
  }
}

TEST_CASE("Damaged HDF5 gives one message, never a crash", "[readers]") {
  const test::TemporaryFolder folder;
  if (!make("pieces", folder)) return;
  for (const char* file : {"pieces.h5", "latest.h5"}) {
    const std::string whole = content(folder.path(file));
    const auto read_all = [](const std::string& bytes) {
      try {
        const Hdf5View view(bytes);
        for (const std::string& name : view.names()) {
          try {
            (void)view.read(name);
          } catch (const std::runtime_error&) {
            continue;
          }
        }
      } catch (const std::runtime_error&) {
        return;
      }
    };
    for (std::size_t at = 0; at < whole.size(); at += 3) {
      for (const int change : {0xFF, 0x01, 0x80}) {
        std::string damaged = whole;
        damaged[at] = char(damaged[at] ^ change);
        read_all(damaged);
      }
    }
    for (std::size_t size = 0; size < whole.size(); size += 37) read_all(whole.substr(0, size));
  }
  SUCCEED();
}

TEST_CASE("WebDataset of tarfile: long names, folders, classes and arrays of all kinds",
          "[readers]") {
  const test::TemporaryFolder folder;
  for (int i = 0; i < 8; ++i) folder.write(std::to_string(i) + ".png", colors(16, 12, i));
  if (!make(GENERATE("tar", "packed_tar"), folder)) return;
  const Opened opened(folder, "WebDatasetReader");
  REQUIRE(opened.dataset->info().captures.size() == 8);
  CHECK(opened.holds(kColor.name));
  CHECK(opened.holds(kHoldsLabels));
  CHECK(opened.holds(kHoldsTightBoxes));
  CHECK_FALSE(opened.holds(kHoldsCamera));
  const StoredCapture first = opened.read(0);
  CHECK(first.split == "train");
  const Frame& frame = first.capture.frames.at(0);
  CHECK(frame.camera.width == 16);
  REQUIRE(frame.instances.size() == 2);
  CHECK(frame.instances[0].labels.at("class") == "mug");
  CHECK(*frame.instances[0].tight_box == PixelBox{2, 3, 7, 8});
  const StoredCapture second = opened.read(1);
  REQUIRE(second.capture.frames.at(0).instances.size() == 1);
  CHECK(second.capture.frames[0].instances[0].labels.at("class") == "3");
  CHECK_FALSE(second.capture.frames[0].instances[0].tight_box);
  CHECK(opened.read(7).split == "val");
}

TEST_CASE("A shard that is cut off tells what it has, and that it ends", "[readers]") {
  const test::TemporaryFolder folder;
  for (int i = 0; i < 8; ++i) folder.write(std::to_string(i) + ".png", colors(16, 12, i));
  if (!make("tar", folder)) return;
  std::string shard = content(folder.path("train-000000.tar"));
  shard.resize(shard.size() / 2);
  folder.write("train-000000.tar", shard);
  const LintReport report = lint(folder);
  CHECK(finds_message(report, "every file can be read", "train-000000.tar: "));
  folder.write("train-000000.tar", std::string(512, 'x') + std::string(1024, '\0'));
  CHECK(finds_message(lint(folder), "every file can be read", "the header at byte 0 is damaged"));
}

TEST_CASE("A packed shard that is cut off or damaged says so", "[readers]") {
  const test::TemporaryFolder folder;
  for (int i = 0; i < 8; ++i) folder.write(std::to_string(i) + ".png", colors(16, 12, i));
  if (!make("packed_tar", folder)) return;
  const std::string file = "train-000000.tar.gz";
  const std::string whole = content(folder.path(file));
  folder.write(file, whole.substr(0, whole.size() / 2));
  CHECK(finds_message(lint(folder), "every file can be read", "its packed content ends too early"));
  // The checksum at the end.
  std::string damaged = whole;
  damaged[damaged.size() - 6] ^= 1;
  folder.write(file, damaged);
  CHECK(finds_message(lint(folder), "every file can be read", "its packed content is damaged"));
  folder.write(file, whole);
  CHECK(lint(folder).findings.empty());
}

TEST_CASE("BOP as the benchmark has it: no node names, gaps in ids, scenes without poses",
          "[readers]") {
  const test::TemporaryFolder folder;
  const std::string models = R"({"5": {"diameter": 173.2, "min_x": -50, "min_y": -50, "min_z": -50,
    "size_x": 100, "size_y": 100, "size_z": 100, "symmetries_discrete": []}})";
  folder.write("models_eval/models_info.json", models);
  folder.write("camera.json", R"({"cx": 20, "cy": 15, "depth_scale": 1.0, "fx": 60, "fy": 60})");
  const std::string scene = "train_real/000002/";
  folder.write(scene + "scene_camera.json",
               R"({"3": {"cam_K": [60, 0, 20, 0, 60, 15, 0, 0, 1], "depth_scale": 0.5,
                         "elev": 45, "mode": 0},
                   "12": {"cam_K": [60, 0, 20, 0, 60, 15, 0, 0, 1], "depth_scale": 0.5}})");
  // One of 10 cm, half a metre ahead and 10 cm to the right.
  folder.write(scene + "scene_gt.json",
               R"({"3": [{"cam_R_m2c": [1,0,0, 0,1,0, 0,0,1], "cam_t_m2c": [100, 0, 500],
                          "obj_id": 5}], "12": []})");
  folder.write(scene + "scene_gt_info.json",
               R"({"3": [{"bbox_obj": [26, 9, 11, 11], "bbox_visib": [26, 9, 11, 11],
                          "px_count_all": 144, "px_count_valid": 144, "px_count_visib": 144,
                          "visib_fract": 1.0}], "12": []})");
  const PixelBox box{26, 9, 38, 21};
  for (const char* kind : {"mask/", "mask_visib/"}) {
    folder.write(scene + kind + "000003_000000.png", mask(40, 30, box));
  }
  for (const char* image : {"000003", "000012"}) {
    folder.write(scene + "rgb/" + image + ".png", colors(40, 30, image[5]));
    folder.write(scene + "depth/" + image + ".png", depth(40, 30, 940));
  }
  // Test images of the benchmark come without poses.
  folder.write("test/000001/rgb/000000.png", colors(40, 30));
  folder.write("test/000001/scene_camera.json",
               R"({"0": {"cam_K": [60, 0, 20, 0, 60, 15, 0, 0, 1], "depth_scale": 0.5}})");
  const Opened opened(folder, "BopReader");
  REQUIRE(opened.dataset->info().captures.size() == 3);
  CHECK(opened.holds(kHoldsPoses));
  CHECK(opened.holds(kHoldsBoxes3d));
  CHECK_FALSE(opened.holds(kHoldsCameraPose));
  CHECK_FALSE(opened.holds(kHoldsNodePaths));
  const StoredCapture test_image = opened.read(0);
  CHECK(test_image.split == "test");
  CHECK(test_image.capture.frames.at(0).instances.empty());
  const StoredCapture stored = opened.read(1);
  CHECK(stored.split == "train");
  const Frame& frame = stored.capture.frames.at(0);
  REQUIRE(frame.instances.size() == 1);
  const Instance& instance = frame.instances[0];
  CHECK(instance.labels.at("class") == "obj_000005");
  CHECK((instance.world_from_node.translation() - Vec3(0.1, 0.0, -0.5)).norm() < 1e-12);
  CHECK((instance.bounds_node.max - Vec3::Constant(0.05)).norm() < 1e-12);
  CHECK(*instance.tight_box == box);
  CHECK(instance.visibility->amodal_pixels == 144);
  CHECK(frame.get(kInstanceId).at(26, 9) == instance.id);
  CHECK(frame.get(kDistanceToImagePlane).at(0, 0) == Approx(0.47));
  CHECK(opened.read(2).capture.frames.at(0).instances.empty());
  // The toolkit computes scene_gt_info.json later: boxes are those of the masks until then.
  std::filesystem::remove(folder.path(scene + "scene_gt_info.json"));
  const Opened early(folder, "BopReader");
  CHECK(early.holds(kHoldsTightBoxes));
  CHECK_FALSE(early.holds(kHoldsOcclusion));
  NameSet boxes{std::string(kHoldsInstances), std::string(kHoldsTightBoxes)};
  CHECK(early.dataset->read(1, boxes).capture.frames.at(0).instances.at(0).tight_box == box);
  std::filesystem::remove_all(folder.path(scene + "mask_visib"));
  const Opened poses(folder, "BopReader");
  CHECK(poses.holds(kHoldsPoses));
  CHECK_FALSE(poses.holds(kHoldsTightBoxes));
  CHECK_FALSE(poses.holds(kInstanceId.name));
  CHECK_FALSE(poses.read(1).capture.frames.at(0).instances.at(0).tight_box.has_value());
  // A scene, and a split, are datasets of their own.
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  for (const char* part : {"train_real", "train_real/000002"}) {
    CHECK(readers.recognise(folder.path(part)) == "BopReader");
    CHECK(readers.open(folder.path(part), "BopReader")->info().captures.size() == 2);
  }
}

TEST_CASE("Faults of a foreign BOP dataset are told with what they are about", "[readers]") {
  const test::TemporaryFolder folder;
  const std::string scene = "train/000000/";
  folder.write(scene + "rgb/000001.png", colors(40, 30));
  folder.write(scene + "mask/000001_000000.png", mask(40, 30, {2, 3, 10, 12}));
  folder.write(scene + "mask_visib/000001_000000.png", mask(40, 30, {2, 3, 8, 12}));
  folder.write(scene + "scene_camera.json",
               R"({"1": {"cam_K": [60, 0, 20, 0, 60, 15, 0, 0, 1]}, "1": {"cam_K": 3},
                   "77": {"cam_K": [60, 0, 20, 0, 60, 15, 0, 0, 1]}})");
  folder.write(scene + "scene_gt.json",
               R"({"1": [{"cam_R_m2c": [2,0,0, 0,1,0, 0,0,1], "cam_t_m2c": [0, 0, 500],
                          "obj_id": 9}]})");
  folder.write(scene + "scene_gt_info.json",
               R"({"1": [{"bbox_obj": [2, 3, 7, 8], "bbox_visib": [2, 3, 5, 8],
                          "px_count_all": 72, "px_count_valid": 99, "px_count_visib": 53,
                          "visib_fract": 0.2}]})");
  const LintReport report = lint(folder);
  INFO(lint_text(report, 50));
  CHECK(finds_message(report, "nothing is there twice",
                      "scene_camera.json: image 1: is there twice"));
  CHECK(finds_message(report, "nothing is missing", "image 77: has no entry"));
  CHECK(finds_message(report, "pose agrees with the keypoints", "cam_R_m2c is not a rotation"));
  CHECK(finds_message(report, "area = count",
                      "its px_count_visib is 53; right would be: its mask has 54"));
  CHECK(finds_message(report, "area = count", "its visib_fract is 0.2"));
  CHECK(finds_message(report, "area = count", "its px_count_valid is 99"));
}

TEST_CASE("Image folders with metadata in lines, in columns, and with a folder per class",
          "[readers]") {
  const std::string png = colors(20, 10);
  SECTION("metadata.jsonl with dictionaries of lists") {
    const test::TemporaryFolder folder;
    folder.write("train/0001.png", png);
    folder.write("train/deep/0002.png", colors(20, 10, 5));
    folder.write("train/metadata.jsonl",
                 "{\"file_name\": \"0001.png\", \"objects\": {\"bbox\": [[3, 4, 5, 2.5], [0, 0, 1, "
                 "1]], \"categories\": [1, 0]}}\r\n\n"
                 "{\"file_name\": \"deep/0002.png\", \"objects\": {\"bbox\": [], \"categories\": "
                 "[]}}");
    const Opened opened(folder, "ImageFolderReader");
    REQUIRE(opened.dataset->info().captures.size() == 2);
    const StoredCapture stored = opened.read(0);
    CHECK(stored.split == "train");
    REQUIRE(stored.capture.frames.at(0).instances.size() == 2);
    CHECK(*stored.capture.frames[0].instances[0].tight_box == PixelBox{3, 4, 8, 7});
    CHECK(stored.capture.frames[0].instances[0].labels.at("class") == "1");
    CHECK(opened.read(1).capture.frames.at(0).instances.empty());
  }
  SECTION("metadata.csv with quotes") {
    const test::TemporaryFolder folder;
    folder.write("a.png", png);
    folder.write("b.png", png);
    folder.write("metadata.csv",
                 "file_name,text,label\na.png,\"one, \"\"two\"\"\nthree\",cat\n"
                 "b.png,plain,dog\n");
    const Opened opened(folder, "ImageFolderReader");
    REQUIRE(opened.dataset->info().captures.size() == 2);
    CHECK(opened.read(1).capture.frames.at(0).instances.at(0).labels.at("class") == "dog");
    CHECK_FALSE(opened.holds(kHoldsTightBoxes));
  }
  SECTION("folders of classes in splits") {
    const test::TemporaryFolder folder;
    for (const char* name : {"train/cat/1.png", "train/dog/1.png", "train/dog/2.png",
                             "test/cat/1.png", "test/dog/7.png"}) {
      folder.write(name, png);
    }
    folder.write("README.md", "x");
    const Opened opened(folder, "ImageFolderReader");
    CHECK(opened.dataset->info().classes == std::vector<std::string>{"cat", "dog"});
    REQUIRE(opened.dataset->info().captures.size() == 5);
    const StoredCapture last = opened.read(4);
    CHECK(last.split == "train");
    CHECK(last.capture.frames.at(0).instances.at(0).labels.at("class") == "dog");
  }
  SECTION("faults") {
    const test::TemporaryFolder folder;
    folder.write("a.png", png);
    folder.write("stray.png", png);
    folder.write("metadata.jsonl",
                 "{\"file_name\": \"a.png\"}\n{\"file_name\": \"a.png\"}\n{\"file_name\": "
                 "\"../a.png\"}\n{\"name\": 3}\n{\"file_name\": \"gone.png\"}\n{\"file_na");
    const LintReport report = lint(folder);
    INFO(lint_text(report, 50));
    CHECK(finds_message(report, "nothing is there twice", "row 2: 'a.png' is there a second time"));
    CHECK(
        finds_message(report, "every file can be read", "'../a.png' lies outside of the dataset"));
    CHECK(finds_message(report, "every file can be read", "a row has no file_name"));
    CHECK(finds_message(report, "nothing is missing", "gone.png: "));
    CHECK(finds_message(report, "nothing is missing", "stray.png: the picture has no row"));
    CHECK(report.findings.size() >= 6);
  }
}

TEST_CASE("A run's overview is no folder of classes", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("overview/a.png", colors(20, 10));
  folder.write("overview/b.png", colors(20, 10));
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  CHECK(readers.recognise(folder.path("overview")).empty());
  CHECK(readers.recognise(folder.path("")).empty());
}
