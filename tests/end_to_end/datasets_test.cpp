// SPDX-License-Identifier: Apache-2.0
// What is made of stored datasets: converted, merged, compared, made again.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "framework/images/codecs.h"
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

// Datasets of boxes as others write them, and what they are in another format, without any reader
// or writer of the program.

constexpr int kWidth = 60;
constexpr int kHeight = 40;

/// Class, x_min, y_min, x_max, y_max; the last two are one past the last pixel.
using Box = std::tuple<std::string, int, int, int, int>;
using Boxes = std::vector<std::vector<Box>>;  ///< Per picture.

const Boxes kDrawn{{{"cat", 10, 8, 40, 25}, {"dog", 3, 4, 20, 30}, {"dog", 40, 0, 60, 12}},
                   {},
                   {{"cat", 0, 0, 60, 40}}};

void write_picture(const fs::path& file, std::uint8_t shade) {
  std::vector<std::uint8_t> samples;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    samples.insert(samples.end(), {shade, std::uint8_t(i % 251), std::uint8_t(i / 7 % 251)});
  }
  const auto bytes = diorama::images::encode_png({samples.data(), kWidth, kHeight, 3, 8});
  write_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

std::string stem_of(std::size_t picture) { return "00000" + std::to_string(picture); }

void write_voc(const fs::path& folder) {
  for (std::size_t i = 0; i < kDrawn.size(); ++i) {
    write_picture(folder / "JPEGImages" / (stem_of(i) + ".png"), std::uint8_t(40 * i));
    std::ostringstream xml;
    xml << "<annotation><filename>" << stem_of(i) << ".png</filename><size><width>60</width>"
        << "<height>40</height><depth>3</depth></size>";
    for (const auto& [name, x_min, y_min, x_max, y_max] : kDrawn[i]) {
      xml << "<object><name>" << name << "</name><bndbox><xmin>" << x_min + 1 << "</xmin><ymin>"
          << y_min + 1 << "</ymin><xmax>" << x_max << "</xmax><ymax>" << y_max
          << "</ymax></bndbox></object>";
    }
    write_file(folder / "Annotations" / (stem_of(i) + ".xml"), xml.str() + "</annotation>");
  }
}

void write_yolo(const fs::path& folder) {
  write_file(folder / "data.yaml", "train: images/train\nval: images/train\nnames: [cat, dog]\n");
  for (std::size_t i = 0; i < kDrawn.size(); ++i) {
    write_picture(folder / "images/train" / (stem_of(i) + ".png"), std::uint8_t(40 * i));
    std::ostringstream lines;
    for (const auto& [name, x_min, y_min, x_max, y_max] : kDrawn[i]) {
      lines << (name == "dog") << ' ' << 0.5 * (x_min + x_max) / kWidth << ' '
            << 0.5 * (y_min + y_max) / kHeight << ' ' << double(x_max - x_min) / kWidth << ' '
            << double(y_max - y_min) / kHeight << '\n';
    }
    write_file(folder / "labels/train" / (stem_of(i) + ".txt"), lines.str());
  }
}

void write_kitti(const fs::path& folder) {
  for (std::size_t i = 0; i < kDrawn.size(); ++i) {
    write_picture(folder / "training/image_2" / (stem_of(i) + ".png"), std::uint8_t(40 * i));
    std::ostringstream lines;
    const char* unknown = " -1 -1 -1 -1000 -1000 -1000 -10\n";
    for (const auto& [name, x_min, y_min, x_max, y_max] : kDrawn[i]) {
      lines << name << " -1 3 -10 " << x_min << ".00 " << y_min << ".00 " << x_max << ".00 "
            << y_max << ".00" << unknown;
    }
    lines << "DontCare -1 -1 -10 1.00 2.00 3.00 4.00" << unknown;
    write_file(folder / "training/label_2" / (stem_of(i) + ".txt"), lines.str());
  }
}

/// With `has_masks` each box is a polygon, too, and two of them overlap. The first is a crowd.
void write_coco(const fs::path& folder, bool has_masks) {
  nlohmann::json page{{"categories", {{{"id", 5}, {"name", "cat"}}, {{"id", 7}, {"name", "dog"}}}},
                      {"images", nlohmann::json::array()},
                      {"annotations", nlohmann::json::array()}};
  for (std::size_t i = 0; i < kDrawn.size(); ++i) {
    write_picture(folder / "images" / (stem_of(i) + ".png"), std::uint8_t(40 * i));
    page["images"].push_back(
        {{"id", i}, {"file_name", stem_of(i) + ".png"}, {"width", kWidth}, {"height", kHeight}});
    for (const auto& [name, x_min, y_min, x_max, y_max] : kDrawn[i]) {
      nlohmann::json object{{"id", page["annotations"].size()},
                            {"image_id", i},
                            {"category_id", name == "cat" ? 5 : 7},
                            {"bbox", {x_min, y_min, x_max - x_min, y_max - y_min}},
                            {"area", (x_max - x_min) * (y_max - y_min)},
                            {"iscrowd", page["annotations"].empty() ? 1 : 0}};
      if (has_masks) {
        object["segmentation"] = {{x_min, y_min, x_max, y_min, x_max, y_max, x_min, y_max}};
      }
      page["annotations"].push_back(std::move(object));
    }
  }
  write_file(folder / "annotations/instances_train.json", page.dump());
}

nlohmann::json coco_page(const fs::path& folder) {
  return nlohmann::json::parse(read_file(folder / "annotations/instances_train.json"));
}

Boxes boxes_of_coco(const fs::path& folder) {
  const auto page = coco_page(folder);
  std::map<int, std::string> names;
  for (const auto& each : page.at("categories")) names[each.at("id")] = each.at("name");
  std::map<int, std::vector<Box>> found;
  for (const auto& image : page.at("images")) found[image.at("id")];
  for (const auto& each : page.at("annotations")) {
    CHECK_FALSE(each.contains("segmentation"));
    const auto box = each.at("bbox").get<std::vector<int>>();
    found.at(each.at("image_id"))
        .emplace_back(names.at(each.at("category_id")), box[0], box[1], box[0] + box[2],
                      box[1] + box[3]);
  }
  Boxes boxes;
  for (auto& [image, own] : found) boxes.push_back(std::move(own));
  return boxes;
}

/// One for each label file, `boxes_of(text)`.
template <class BoxesOf>
Boxes boxes_of_files(const fs::path& folder, const std::string& ending, BoxesOf&& boxes_of) {
  Boxes boxes;
  for (const auto& [name, text] : tree(folder)) {
    if (name.ends_with(ending)) boxes.push_back(boxes_of(text));
  }
  return boxes;
}

std::vector<Box> boxes_of_yolo(const std::string& text) {
  std::vector<Box> boxes;
  std::istringstream in(text);
  double x = 0, y = 0, width = 0, height = 0;
  for (int number = 0; in >> number >> x >> y >> width >> height;) {
    const auto edge = [](double share, int size) { return int(std::lround(share * size)); };
    boxes.emplace_back(number == 0 ? "cat" : "dog", edge(x - width / 2, kWidth),
                       edge(y - height / 2, kHeight), edge(x + width / 2, kWidth),
                       edge(y + height / 2, kHeight));
  }
  return boxes;
}

std::vector<Box> boxes_of_voc(const std::string& text) {
  std::vector<Box> boxes;
  for (std::size_t at = text.find("<object>"); at != text.npos;
       at = text.find("<object>", at + 1)) {
    const auto element = [&](const std::string& name) {
      const std::size_t begin = text.find("<" + name + ">", at) + name.size() + 2;
      return text.substr(begin, text.find('<', begin) - begin);
    };
    boxes.emplace_back(element("name"), std::stoi(element("xmin")) - 1,
                       std::stoi(element("ymin")) - 1, std::stoi(element("xmax")),
                       std::stoi(element("ymax")));
  }
  return boxes;
}

std::vector<Box> boxes_of_kitti(const std::string& text) {
  std::vector<Box> boxes;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    CHECK_THAT(line, ContainsSubstring(" -1.00 3 -10.00 "));
    CHECK(line.ends_with(" -1.0000 -1.0000 -1.0000 -1000.0000 -1000.0000 -1000.0000 -10.0000"));
    std::istringstream words(line);
    std::string name, skipped;
    double x_min = 0, y_min = 0, x_max = 0, y_max = 0;
    words >> name >> skipped >> skipped >> skipped >> x_min >> y_min >> x_max >> y_max;
    boxes.emplace_back(name, int(x_min), int(y_min), int(x_max), int(y_max));
  }
  return boxes;
}

}  // namespace

TEST_CASE("boxes of others, which have no masks, become boxes of any format", "[convert]") {
  const TemporaryFolder folder;
  write_voc(folder / "voc");
  write_yolo(folder / "yolo");
  write_kitti(folder / "kitti");
  write_coco(folder / "coco", false);
  for (const std::string from : {"voc", "yolo", "kitti"}) {
    INFO(from);
    const Outcome outcome = succeed(
        {"convert", from, "--writer", "CocoWriter val_share=0", "-o", "of_" + from}, folder);
    CHECK_THAT(outcome.errors,
               ContainsSubstring("--writer CocoWriter: is taken with masks=false keypoints=false"));
    CHECK(boxes_of_coco(folder / ("of_" + from) / "CocoWriter") == kDrawn);
    succeed({"lint", "of_" + from}, folder);
  }
  succeed({"convert", "coco", "--writer", "CocoWriter", "--writer", "YoloWriter", "--writer",
           "VocWriter image_format=png", "--writer", "KittiWriter", "--writer", "ImageFolderWriter",
           "-o", "all"},
          folder);
  succeed({"lint", "all"}, folder);
  CHECK(boxes_of_coco(folder / "all/CocoWriter") == kDrawn);
  CHECK(boxes_of_files(folder / "all/YoloWriter/labels", ".txt", boxes_of_yolo) == kDrawn);
  CHECK(boxes_of_files(folder / "all/VocWriter/Annotations", ".xml", boxes_of_voc) == kDrawn);
  CHECK(boxes_of_files(folder / "all/KittiWriter/training/label_2", ".txt", boxes_of_kitti) ==
        kDrawn);
  const std::string rows = read_file(folder / "all/ImageFolderWriter/train/metadata.jsonl");
  CHECK_THAT(rows, ContainsSubstring("\"bbox\": [[10, 8, 30, 17], [3, 4, 17, 26]"));
  CHECK_THAT(rows, !ContainsSubstring("area") && !ContainsSubstring("visible_share"));
  // What is a crowd stays one, also from there on.
  succeed({"convert", "all/CocoWriter", "--writer", "CocoWriter", "-o", "again"}, folder);
  succeed({"lint", "again"}, folder);
  for (const char* place : {"all/CocoWriter", "again/CocoWriter"}) {
    std::vector<int> crowds;
    const auto page = coco_page(folder / place);
    for (const auto& each : page.at("annotations")) {
      crowds.push_back(each.at("iscrowd"));
    }
    CHECK(crowds == std::vector{1, 0, 0, 0});
  }
  // A parameter that somebody names stays as it is.
  const Outcome asked =
      run({"convert", "voc", "--writer", "CocoWriter masks=true", "-o", "masks"}, folder.path());
  CHECK(asked.exit_code == 2);
  CHECK_THAT(asked.errors, ContainsSubstring("does not hold instance_id, which the writers need"));
  CHECK_FALSE(fs::exists(folder / "masks"));
}

TEST_CASE("masks that overlap stay masks, and what is lost of them is said", "[convert]") {
  const TemporaryFolder folder;
  write_coco(folder / "coco", true);
  const Outcome outcome = succeed({"convert", "coco", "--writer", "CocoWriter val_share=0",
                                   "--writer", "YoloWriter task=segment", "-o", "out"},
                                  folder);
  CHECK_THAT(outcome.errors,
             ContainsSubstring("masks overlap in 1 of 3 captures, first in capture 0; a pixel of "
                               "several objects becomes the smallest one's, of which 0 objects "
                               "lose all pixels"));
  succeed({"lint", "out"}, folder);
  // The dog, which is smaller, keeps what it shares with the cat.
  std::vector<std::vector<int>> boxes;
  std::vector<int> areas;
  const auto page = coco_page(folder / "out/CocoWriter");
  for (const auto& each : page.at("annotations")) {
    CHECK(each.contains("segmentation"));
    boxes.push_back(each.at("bbox").get<std::vector<int>>());
    areas.push_back(each.at("area").get<int>());
  }
  CHECK(boxes == std::vector<std::vector<int>>{
                     {20, 8, 20, 17}, {3, 4, 17, 26}, {40, 0, 20, 12}, {0, 0, 60, 40}});
  CHECK(areas == std::vector{20 * 17, 17 * 26, 20 * 12, 60 * 40});
}

TEST_CASE("levels of what is hidden or cut off go from VOC to KITTI and back", "[convert]") {
  const TemporaryFolder folder;
  write_picture(folder / "voc/JPEGImages/0.png", 7);
  std::string xml =
      "<annotation><filename>0.png</filename><size><width>60</width><height>40</height>"
      "<depth>3</depth></size>";
  int place = 0;
  for (const char* flags : {"000", "010", "110", "011", "111"}) {
    const std::string x = std::to_string(10 * place + 1);
    xml += std::string("<object><name>cat</name><truncated>") + flags[0] +
           "</truncated><occluded>" + flags[1] + "</occluded><difficult>" + flags[2] +
           "</difficult><bndbox><xmin>" + x + "</xmin><ymin>3</ymin><xmax>" +
           std::to_string(10 * ++place) + "</xmax><ymax>30</ymax></bndbox></object>";
  }
  write_file(folder / "voc/Annotations/0.xml", xml + "</annotation>");
  const Outcome outcome =
      succeed({"convert", "voc", "--writer", "KittiWriter", "-o", "kitti"}, folder);
  CHECK_THAT(outcome.errors, ContainsSubstring("holds levels of what is hidden or cut off"));
  succeed({"lint", "kitti"}, folder);
  std::istringstream lines(read_file(folder / "kitti/KittiWriter/training/label_2/000000.txt"));
  std::vector<std::pair<std::string, int>> levels;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string name, truncation;
    int occlusion = 0;
    words >> name >> truncation >> occlusion;
    levels.emplace_back(truncation, occlusion);
  }
  CHECK(levels == std::vector<std::pair<std::string, int>>{
                      {"0.00", 0}, {"0.00", 1}, {"0.25", 1}, {"0.00", 2}, {"0.25", 2}});
  for (const std::string from : {"voc", "kitti"}) {
    succeed({"convert", from, "--writer", "VocWriter", "-o", "from_" + from}, folder);
    succeed({"lint", "from_" + from}, folder);
    const std::string text =
        read_file(folder / ("from_" + from) / "VocWriter/Annotations/000000_camera.xml");
    std::string flags;
    for (const char* name : {"<truncated>", "<occluded>", "<difficult>"}) {
      for (std::size_t at = text.find(name); at != text.npos; at = text.find(name, at + 1)) {
        flags += text[at + std::string(name).size()];
      }
    }
    INFO(from);
    CHECK(flags == std::string("0010101111") + (from == "voc" ? "00011" : "00000"));
  }
}

TEST_CASE("what a dataset does not tell of places and boxes is not written", "[convert]") {
  const TemporaryFolder folder;
  make(folder, job_of_writers(7, R"(
  - {type: VocWriter, name: voc}
  - {type: BasicWriter, name: flat, rgb: true, instance_segmentation: true, camera_params: true,
     bounding_box_2d_tight: true, distance_to_image_plane: true}
)"));
  succeed({"convert", "out/voc", "--writer", "KittiWriter", "--writer", "Hdf5Writer", "--writer",
           "WebDatasetWriter", "-o", "all"},
          folder);
  succeed({"lint", "all"}, folder);
  for (const char* writer : {"Hdf5Writer", "WebDatasetWriter"}) {
    for (const auto& [file, bytes] : tree(folder / "all" / writer)) {
      INFO(writer << " " << file);
      CHECK(bytes.find("bounds_min") == bytes.npos);
      CHECK(bytes.find("world_from_node") == bytes.npos);
    }
  }
  CHECK_THAT(read_file(folder / "all/KittiWriter/training/label_2/000000.txt"),
             ContainsSubstring(" -1.0000 -1.0000 -1.0000 -1000.0000 -1000.0000 -1000.0000 -10"));
  const Outcome unplaced =
      run({"convert", "out/flat", "--writer", "BopWriter", "-o", "bop"}, folder.path());
  CHECK(unplaced.exit_code != 0);
  CHECK_THAT(unplaced.errors, ContainsSubstring("BOP has nothing to say but poses"));
  // Poses without masks or boxes: nothing tells which pixels objects have.
  write_picture(folder / "poses/train/000000/rgb/000000.png", 7);
  write_file(folder / "poses/train/000000/scene_camera.json",
             R"({"0": {"cam_K": [60, 0, 30, 0, 60, 20, 0, 0, 1]}})");
  write_file(folder / "poses/train/000000/scene_gt.json",
             R"({"0": [{"cam_R_m2c": [1,0,0, 0,1,0, 0,0,1], "cam_t_m2c": [0, 0, 500],
                        "obj_id": 5}]})");
  CHECK_THAT(succeed({"stats", "poses"}, folder).output, ContainsSubstring("obj_000005"));
  const Outcome boxless =
      run({"convert", "poses", "--writer", "VocWriter masks=false", "-o", "voc"}, folder.path());
  CHECK(boxless.exit_code == 2);
  CHECK_THAT(boxless.errors,
             ContainsSubstring("holds neither tight_boxes nor instance_id, so --writer VocWriter "
                               "with masks=false would write no object"));
  CHECK_FALSE(fs::exists(folder / "voc"));
}

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
  - {type: MotWriter, name: mot}
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
  // A share of what is seen becomes one of whole pixels.
  const Outcome shares = succeed(
      {"convert", "out/mot", "--writer", "MotWriter masks=false", "-o", "mot_again"}, folder);
  CHECK_THAT(shares.errors, ContainsSubstring("what share of an object is seen"));
  succeed({"lint", "mot_again"}, folder);
  const auto lines_of = [&](const fs::path& dataset) {
    std::vector<std::vector<double>> lines;
    for (const auto& [file, text] : tree(folder / dataset)) {
      if (!file.ends_with("gt.txt")) continue;
      std::istringstream stream(text);
      for (std::string line; std::getline(stream, line);) {
        std::ranges::replace(line, ',', ' ');
        std::istringstream words(line);
        lines.emplace_back(std::istream_iterator<double>(words), std::istream_iterator<double>());
      }
    }
    return lines;
  };
  const auto before = lines_of("out/mot");
  const auto after = lines_of("mot_again/MotWriter");
  REQUIRE(before.size() == after.size());
  bool is_any_hidden = false;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const double slack = 4.0 / (before[i].at(4) * before[i].at(5));
    CHECK(std::abs(after[i].at(8) - before[i].at(8)) <= slack);
    is_any_hidden |= before[i].at(8) < 0.9;
  }
  CHECK(is_any_hidden);
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
