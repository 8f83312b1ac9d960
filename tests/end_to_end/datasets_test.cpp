// SPDX-License-Identifier: Apache-2.0
// What is made of stored datasets: converted, merged, compared, made again.
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

std::string job_of_writers(int seed, const std::string& writers) {
  return "seed: " + std::to_string(seed) + R"(
total_captures: 6
environments:
  - {type: shapes, shapes: [cube]}
environment:
  colliders: triangle_mesh
objects:
  - {type: shapes, name: targets, under: /Assets, count: 4, label_pattern: "^",
     gravity_disabled_chance: 0.5}
lights:
  - {type: dome, name: sky}
cameras:
  - {type: pinhole, name: cam, count: 2, width: 64, height: 44}
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-1.0, 1.0], [-1.0, 1.0], [1.5, 2.5]], scale: [0.3, 0.5]}
  - {type: orbit_cameras, name: cameras, on: [floating], nodes: "/Cameras/*",
     targets: "/Assets/*", distance: [2.0, 3.0], polar_angle_deg: [10, 60]}
renderer: {type: "null"}
timeline:
  - simulate: 4
  - {capture: floating, count: 3}
output: {folder: out}
writers:
)" + writers;
}

constexpr const char* kBasic = R"(
  - {type: BasicWriter, name: basic, rgb: true, instance_segmentation: true,
     bounding_box_2d_tight: true, bounding_box_3d: true, camera_params: true,
     distance_to_camera: true}
)";
constexpr const char* kTraining = R"(
  - {type: CocoWriter, name: CocoWriter, amodal: false, keypoints: false}
  - {type: YoloWriter, name: YoloWriter, task: segment}
)";

void make(const TemporaryFolder& folder, const std::string& text) {
  write_file(folder / "job.yaml", text);
  const Outcome made = run({"run", "job.yaml"}, folder.path());
  INFO(made.errors);
  REQUIRE(made.exit_code == 0);
}

Outcome succeed(const std::vector<std::string>& arguments, const TemporaryFolder& folder) {
  const Outcome outcome = run(arguments, folder.path());
  INFO(arguments[0] << ": " << outcome.output << outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  return outcome;
}

using Files = std::map<std::string, std::string>;

void expect_same_tree(const Files& one, const Files& other) {
  REQUIRE(!one.empty());
  CHECK(difference(one, other) == "");
}

/// Without a sign of zero.
double rounded(double number) { return std::round(number * 1e3) + 0.0; }

/// Cameras go through 32-bit numbers in the first format.
Files without_lens_digits(const fs::path& folder) {
  Files files = tree(folder);
  for (auto& [name, text] : files) {
    if (!name.starts_with("annotations/")) continue;
    auto json = nlohmann::ordered_json::parse(text);
    for (auto& image : json.at("images")) {
      REQUIRE(image.contains("intrinsics"));
      for (auto& number : image.at("intrinsics")) number = rounded(number.get<double>());
      for (auto& row : image.at("world_from_camera")) {
        for (auto& number : row) number = rounded(number.get<double>());
      }
    }
    text = json.dump();
  }
  return files;
}

}  // namespace

TEST_CASE("a converted dataset is the one that the run would have written", "[convert]") {
  const TemporaryFolder folder;
  make(folder, job_of_writers(7, std::string(kBasic) + kTraining));
  const Outcome first = succeed(
      {"convert", "out/basic", "--writer", "CocoWriter amodal=false keypoints=false", "-o", "coco"},
      folder);
  CHECK_THAT(first.errors, ContainsSubstring("does not hold truncation"));
  CHECK_THAT(first.errors, ContainsSubstring("no writer takes distance_to_camera"));
  expect_same_tree(without_lens_digits(folder / "out" / "CocoWriter"),
                   without_lens_digits(folder / "coco" / "CocoWriter"));
  succeed({"convert", "coco", "--writer", "{type: YoloWriter, task: segment}", "-o", "yolo"},
          folder);
  expect_same_tree(tree(folder / "out" / "YoloWriter"), tree(folder / "yolo" / "YoloWriter"));
  succeed({"lint", "yolo"}, folder);
  // What the source does not hold is made up so that it agrees with the rest, and is a number.
  succeed({"convert", "out/basic", "--writer", "CocoWriter", "-o", "amodal"}, folder);
  succeed({"lint", "amodal"}, folder);
  succeed({"convert", "coco", "--writer", "PoseWriter", "-o", "pose"}, folder);
  for (const auto& [file, text] : tree(folder / "pose" / "PoseWriter")) {
    if (!file.ends_with(".json")) continue;
    INFO(file);
    CHECK(text.find("NaN") == std::string::npos);
    CHECK(text.find("Infinity") == std::string::npos);
  }
}

TEST_CASE("clips of a rig stay clips, or become pictures that say so", "[convert]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", R"(
seed: 11
total_captures: 12
environments: [{type: shapes, shapes: [cube]}]
environment: {colliders: triangle_mesh}
objects:
  - {type: shapes, name: things, under: /Assets, count: 6, label_pattern: "^"}
lights: [{type: dome, name: sky}]
cameras:
  - {type: pinhole, name: eyes, width: 96, height: 72, rig: [{name: left}, {name: right, position: [0.1, 0, 0]}]}
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.6, 0.6], [-0.6, 0.6], [1.4, 2.0]], scale: [0.1, 0.2]}
  - {type: camera_path, name: path, on: [fall], kind: orbit, targets: "/Environment", distance: 3.0,
     polar_angle_deg: 40, turn_deg_s: 40}
settle: {policy: keep}
renderer: {type: "null"}
timeline: [{simulate: 14}, {record: {name: fall, fps: 24, seconds: 0.25}}]
writers:
  - {type: BasicWriter, name: basic, rgb: true, instance_segmentation: true, semantic_segmentation: true,
     bounding_box_2d_tight: true, bounding_box_2d_loose: true, bounding_box_3d: true, camera_params: true,
     distance_to_camera: true}
  - {type: Hdf5Writer, name: hdf5}
  - {type: BopWriter, name: bop}
  - {type: VocWriter, name: voc}
  - {type: DataVisualizationWriter, name: nothing_asked}
output: {folder: out}
)");
  succeed({"run", "job.yaml"}, folder);
  succeed({"lint", "out"}, folder);
  for (const std::string from : {"basic", "bop", "hdf5"}) {
    INFO(from);
    succeed({"convert", "out/" + from, "--writer", "CocoWriter", "-o", "coco_" + from}, folder);
    succeed({"lint", "coco_" + from}, folder);
    succeed(
        {"merge", "out/" + from, "out/" + from, "--writer", "CocoWriter", "-o", "twice_" + from},
        folder);
    succeed({"lint", "twice_" + from}, folder);
  }
  const Outcome single = succeed(
      {"convert", "out/voc", "--writer", "CocoWriter keypoints=false", "-o", "coco_voc"}, folder);
  CHECK_THAT(single.errors, ContainsSubstring("become captures of their own"));
  // Objects of which nothing tells whether they are the same are others in each picture.
  succeed({"lint", "coco_voc"}, folder);
}

TEST_CASE("what writers need and a dataset does not hold is said before anything is written",
          "[convert]") {
  const TemporaryFolder folder;
  make(folder, job_of_writers(7, kTraining));
  const Outcome depth =
      run({"convert", "out/CocoWriter", "--writer", "BopWriter", "-o", "bop"}, folder.path());
  CHECK(depth.exit_code == 2);
  CHECK_THAT(depth.errors,
             ContainsSubstring("does not hold distance_to_image_plane, which the writers need"));
  CHECK_FALSE(fs::exists(folder / "bop"));
  const Outcome both = run({"convert", "out", "--writer", "VocWriter", "-o", "voc"}, folder.path());
  CHECK(both.exit_code == 2);
  CHECK_THAT(both.errors, ContainsSubstring("holds several datasets, name one"));
  const Outcome typo =
      run({"convert", "out/CocoWriter", "--writer", "VocWriter val_shar=0.5", "-o", "voc"},
          folder.path());
  CHECK(typo.exit_code == 3);
  CHECK_THAT(typo.errors, ContainsSubstring("val_share"));
  const Outcome noted =
      succeed({"convert", "out/CocoWriter", "--writer", "VocWriter", "-o", "voc"}, folder);
  CHECK_THAT(noted.errors, ContainsSubstring("objects count as neither hidden nor cut off"));
}

TEST_CASE("a damaged file ends a conversion, which names it", "[convert]") {
  const TemporaryFolder folder;
  make(folder, job_of_writers(7, kBasic));
  const fs::path picture = folder / "out/basic/rp_cam_1/rgb/rgb_0004.png";
  REQUIRE(fs::exists(picture));
  write_file(picture, "no picture");
  const Outcome outcome =
      run({"convert", "out", "--writer", "CocoWriter amodal=false keypoints=false", "-o", "coco"},
          folder.path());
  CHECK(outcome.exit_code == 5);
  CHECK_THAT(outcome.errors, ContainsSubstring("rgb_0004.png"));
}

TEST_CASE("merged datasets have new numbers, all classes and their own splits", "[merge]") {
  const TemporaryFolder one;
  make(one, job_of_writers(7, kTraining));
  const TemporaryFolder two;
  make(two, job_of_writers(8, kTraining));
  const std::string other = (two / "out" / "CocoWriter").string();
  succeed({"merge", "out/CocoWriter", other, "--writer", "CocoWriter amodal=false keypoints=false",
           "-o", "all"},
          one);
  succeed({"lint", "all"}, one);
  const std::string page = read_file(one / "all" / "CocoWriter" / "dataset.json");
  CHECK_THAT(page, ContainsSubstring("\"captures\": 12"));
  const Outcome difference = run({"diff", "out/CocoWriter", "all"}, one.path());
  CHECK(difference.exit_code == 1);
  CHECK_THAT(difference.output, ContainsSubstring("captures: 6 | 12"));
  // The first half is the first dataset, its split included.
  for (const auto& [file, bytes] : tree(one / "out" / "CocoWriter")) {
    if (!file.ends_with(".png")) continue;
    INFO(file);
    CHECK(read_file(one / "all" / "CocoWriter" / file) == bytes);
  }
}

TEST_CASE("diff finds nothing between equal datasets, and what was changed", "[diff]") {
  const TemporaryFolder folder;
  make(folder, job_of_writers(7, std::string(kBasic) + kTraining));
  fs::copy(folder / "out", folder / "copy", fs::copy_options::recursive);
  const Outcome same = succeed({"diff", "out", "copy"}, folder);
  CHECK(same.output.empty());
  // The same captures in another format.
  succeed({"diff", "out/CocoWriter", "copy/CocoWriter"}, folder);
  const std::string labels = "copy/YoloWriter/labels/train";
  const auto entry = *fs::directory_iterator(folder / labels);
  std::string text = read_file(entry.path());
  REQUIRE(!text.empty());
  text[0] = text[0] == '0' ? '1' : '0';
  write_file(entry.path(), text);
  const Outcome changed = run({"diff", "out", "copy"}, folder.path());
  CHECK(changed.exit_code == 1);
  CHECK_THAT(changed.output, ContainsSubstring("YoloWriter: capture"));
  CHECK_THAT(changed.output, ContainsSubstring("1 of 6 captures differ"));
  CHECK(run({"diff", "out", "absent"}, folder.path()).exit_code == 2);
}

TEST_CASE("captures are made again of the same assets alone", "[replay][lint]") {
  const TemporaryFolder folder;
  for (const char* root : {"first", "second"}) {
    fs::create_directories(folder / root);
    const std::string height = root[0] == 'f' ? "1" : "2";
    write_file(folder / root / "wedge.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 " + height +
                                                "\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  }
  write_file(folder / "job.yaml", R"(
environments: [{type: files, files: [/wedge.obj]}]
cameras: [{type: pinhole, name: eye, width: 16, height: 12}]
renderer: {type: "null"}
timeline: [{capture: now}]
writers: [{type: PoseWriter, name: pose}]
)");
  succeed({"--assets-root", "first", "run", "job.yaml", "--output", "out"}, folder);
  succeed({"--assets-root", "first", "replay", "out", "--capture", "0"}, folder);
  succeed({"--assets-root", "first", "lint", "--scenes", "out"}, folder);
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"replay", "out", "--capture", "0"},
        {"verify", "out", "--sample", "1"},
        {"lint", "--scenes", "out"}}) {
    std::vector<std::string> arguments{"--assets-root", "second"};
    arguments.insert(arguments.end(), command.begin(), command.end());
    const Outcome outcome = run(arguments, folder.path());
    INFO(outcome.output);
    CHECK(outcome.exit_code == 5);
    CHECK_THAT(outcome.errors,
               ContainsSubstring("out: was made of other assets: /wedge.obj has other "
                                 "files now; --assets-root names the folder"));
  }
}

TEST_CASE("captures are made again, byte by byte", "[replay]") {
  const TemporaryFolder folder;
  make(folder, job_of_writers(7, std::string(kBasic) + kTraining));
  const Outcome replayed = succeed({"replay", "out", "--capture", "4"}, folder);
  CHECK_THAT(replayed.output, ContainsSubstring("1 captures made again"));
  CHECK_THAT(replayed.output, ContainsSubstring(" 0 differ"));
  succeed({"verify", "out", "--sample", "3"}, folder);
  // Other pixels are asked for.
  const Outcome other = succeed(
      {"replay", "out", "--capture", "4", "--set", "cameras[0].width=60", "-o", "again"}, folder);
  CHECK_THAT(other.output, ContainsSubstring("rgb_0004.png differs"));
  CHECK(fs::exists(folder / "again/basic/rp_cam_0/rgb/rgb_0004.png"));
  CHECK_FALSE(fs::exists(folder / "again/basic/rp_cam_0/rgb/rgb_0003.png"));
  write_file(folder / "out/basic/rp_cam_0/rgb/rgb_0002.png", "x");
  const Outcome differs = run({"verify", "out", "--sample", "6"}, folder.path());
  CHECK(differs.exit_code == 9);
  CHECK_THAT(differs.output, ContainsSubstring("capture 2: basic/rp_cam_0/rgb/rgb_0002.png"));
  const Outcome absent = run({"replay", "out", "--capture", "6"}, folder.path());
  CHECK(absent.exit_code == 2);
  CHECK_THAT(absent.errors, ContainsSubstring("has no capture 6"));
}
