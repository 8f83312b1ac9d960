// SPDX-License-Identifier: Apache-2.0
// Seeded faults, each in every format to which it applies.
#include <algorithm>
#include <functional>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>

#include "diorama/error.h"
#include "framework/datasets/frame_checks.h"
#include "framework/datasets/frame_copy.h"
#include "framework/lint/dataset_on_disk.h"
#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "plugins/writer_support/sample_dataset.h"
#include "reader_support/object_masks.h"
#include "support/catch.h"
#include "writer_yolo/polygon_parts.h"

using namespace diorama;
using test::DatasetOnDisk;
using Json = nlohmann::ordered_json;

namespace {

Capture copy_of(const Capture& capture) {
  Capture copy;
  copy.index = capture.index;
  copy.phase = capture.phase;
  copy.environment = capture.environment;
  for (const Frame& frame : capture.frames) copy.frames.push_back(copy_of(frame));
  return copy;
}

/// One capture of the sample by its two cameras.
const Capture& capture_through(LensModel lens) {
  static std::map<LensModel, Capture> known;
  if (const auto found = known.find(lens); found != known.end()) return found->second;
  test::SampleScene sample(72, 48, 2);
  for (const NodeId node : sample.cameras) {
    Camera& camera = *sample.scene.edit(node).camera;
    camera.lens = lens;
    camera.distortion = {-0.1, 0.02, 0.001, -0.002, 0.01, 0.02, -0.01, 0.003};
    camera.fisheye_polynomial = {0.0, 0.95 / camera.fx, 1e-5, 0.0, 0.0, 0.0};
    camera.fisheye_max_angle_rad = 1.3;
  }
  return known.emplace(lens, test::ray_cast_capture(sample, 0)).first->second;
}

DatasetOnDisk write(const test::SampleFormat& format, const Capture& capture) {
  test::EncodingHost host;
  DatasetInfo dataset = test::sample_dataset(test::SampleScene(8, 6));
  dataset.capture_count = 1;
  return DatasetOnDisk(format.write(host, dataset, {&capture}));
}

test::SampleFormat format_named(const std::string& name) {
  const auto formats = test::every_format();
  return *std::ranges::find(formats, name, &test::SampleFormat::name);
}

/// A folder whose own page is damaged is no dataset any more, which is an error.
bool is_found(const DatasetOnDisk& dataset) {
  try {
    return !dataset.lint().findings.empty();
  } catch (const Error&) {
    return true;
  }
}

/// Writes the capture with one label changed, in one format after the other.
void expect_found(const std::vector<std::string>& formats, const std::string& check,
                  const std::function<void(Frame&)>& spoil) {
  Capture spoilt = copy_of(capture_through(LensModel::Pinhole));
  for (Frame& frame : spoilt.frames) spoil(frame);
  for (const std::string& name : formats) {
    INFO(name);
    const LintReport report = write(format_named(name), spoilt).lint();
    INFO(lint_text(report));
    CHECK(std::ranges::count(report.findings, check, &LintFinding::check) > 0);
  }
}

Instance& seen(Frame& frame, const std::string& path) {
  return *std::ranges::find(frame.instances, path, &Instance::node_path);
}

/// Changes the first object of the first pose file.
LintReport lint_with_pose(const std::string& format, const std::function<void(Json&)>& spoil) {
  const auto dataset = write(format_named(format), capture_through(LensModel::Pinhole));
  const std::string file = "rp_cam_0/000000.json";
  Json json = Json::parse(dataset.read(file));
  spoil(json.at("objects").at(0));
  dataset.write(file, json.dump(2));
  return dataset.lint();
}

bool has_finding(const LintReport& report, const std::string& check) {
  return std::ranges::count(report.findings, check, &LintFinding::check) > 0;
}

}  // namespace

TEST_CASE("what is seen through any lens is found good in every format", "[lint]") {
  const LensModel lens =
      GENERATE(LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial);
  for (const test::SampleFormat& format : test::every_format()) {
    const LintReport report = write(format, capture_through(lens)).lint();
    INFO(int(lens) << " " << lint_text(report, 20));
    CHECK(report.findings.empty());
    CHECK(report.checks > (format.name == "boxes" ? 5 : 20));
  }
}

TEST_CASE("objects that are largely outside of the picture are found good", "[lint]") {
  test::SampleScene sample(36, 24, 2);
  for (const NodeId node : sample.cameras) {
    Camera& camera = *sample.scene.edit(node).camera;
    camera.fx *= 3.0;
    camera.fy *= 3.0;
    camera.cy -= 9.0;
  }
  const Capture capture = test::ray_cast_capture(sample, 0);
  for (const test::SampleFormat& format : test::every_format()) {
    const LintReport report = write(format, capture).lint();
    INFO(lint_text(report, 20));
    CHECK(report.findings.empty());
  }
}

TEST_CASE("any file that is missing or cut short is found", "[lint]") {
  for (const test::SampleFormat& format : test::every_format()) {
    const auto dataset = write(format, capture_through(LensModel::Pinhole));
    std::vector<std::string> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(dataset.folder())) {
      if (entry.is_regular_file()) {
        files.push_back(entry.path().lexically_relative(dataset.folder()).string());
      }
    }
    for (const std::string& file : files) {
      INFO(format.name << ": " << file);
      const std::string content = dataset.read(file);
      dataset.remove(file);
      // Without its page a dataset may be anybody's.
      const bool is_page = file == "dataset.json" || file == "metadata.txt";
      if (!is_page) CHECK(is_found(dataset));
      dataset.write(file, content.substr(0, content.size() / 2));
      if (content.size() > 1) CHECK(is_found(dataset));
      dataset.write(file, content);
    }
    CHECK_FALSE(is_found(dataset));
  }
}

TEST_CASE("a box that is one pixel off its mask is found", "[lint]") {
  expect_found({"basic", "basic_raw", "coco", "voc", "bop", "webdataset"}, "box = extent of mask",
               [](Frame& frame) { seen(frame, "/Assets/crate").tight_box->x_min += 1; });
}

TEST_CASE("an occlusion order that the masks contradict is found", "[lint]") {
  constexpr const char* kOrder = "occlusion order agrees with masks";
  expect_found({"coco"}, kOrder, [](Frame& frame) {
    if (!frame.occlusions.empty()) frame.occlusions.front().pixels += 1000;
  });
  expect_found({"coco"}, kOrder, [](Frame& frame) {
    for (Occlusion& occlusion : frame.occlusions) std::swap(occlusion.front, occlusion.behind);
  });
  expect_found({"coco"}, kOrder, [](Frame& frame) { frame.occlusions.clear(); });
}

TEST_CASE("a box off its object is found where there are no masks", "[lint]") {
  expect_found({"kitti", "yolo_pose", "coco"}, "pose and camera reproject onto the mask",
               [](Frame& frame) {
                 PixelBox& box = *seen(frame, "/Assets/crate").tight_box;
                 box = {0, 0, box.width(), box.height()};
               });
  expect_found({"kitti"}, "depth back-projects", [](Frame& frame) {
    PixelBox& box = *seen(frame, "/Assets/mug").tight_box;
    box.x_min -= 3;
  });
  const auto yolo = write(format_named("yolo_detect"), capture_through(LensModel::Pinhole));
  const std::string file = "labels/train/000000_cam_0.txt";
  std::istringstream words(yolo.read(file));
  std::string id, x, rest;
  words >> id >> x;
  std::getline(words, rest, '\0');
  yolo.write(file, id + " " + std::to_string(std::stod(x) + 0.3 / 72.0) + rest);
  CHECK(has_finding(yolo.lint(), "box = extent of mask"));
}

TEST_CASE("polygons, rotated boxes and keypoints that are off are found", "[lint]") {
  const std::string file = "labels/train/000000_cam_0.txt";
  const auto findings = [&](const char* format,
                            const std::function<void(std::vector<double>&)>& spoil) {
    const auto yolo = write(format_named(format), capture_through(LensModel::Pinhole));
    std::istringstream lines(yolo.read(file));
    std::string text;
    bool is_first = true;
    for (std::string line; std::getline(lines, line); is_first = false) {
      std::istringstream words(line);
      std::vector<double> numbers{std::istream_iterator<double>(words), {}};
      if (is_first) spoil(numbers);
      text += std::to_string(int(numbers[0]));
      for (std::size_t i = 1; i < numbers.size(); ++i) text += " " + std::to_string(numbers[i]);
      text += "\n";
    }
    yolo.write(file, text);
    return yolo.lint();
  };
  const std::string partition = "pixels partition into instances";
  const auto untouched = [](std::vector<double>&) {};
  const auto shift_a_corner = [](std::vector<double>& numbers) { numbers[3] += 0.3 / 72.0; };
  for (const char* format : {"yolo_segment", "yolo_obb"}) {
    INFO(format);
    CHECK(findings(format, untouched).findings.empty());
  }
  CHECK(has_finding(findings("yolo_segment", shift_a_corner), partition));
  CHECK(has_finding(findings("yolo_segment",
                             [](std::vector<double>& numbers) {
                               numbers.resize(7);
                               numbers[3] = numbers[5] = numbers[1];
                             }),
                    partition));
  CHECK(has_finding(findings("yolo_obb", shift_a_corner), "every file can be read"));
  const std::string pose = "pose and camera reproject onto the mask";
  CHECK(has_finding(
      findings("yolo_pose",
               [](std::vector<double>& numbers) { numbers[8] += numbers[8] > 0.5 ? -0.4 : 0.4; }),
      pose));
  CHECK(has_finding(findings("yolo_pose", [](std::vector<double>& numbers) { numbers[7] = 0.0; }),
                    "labels lie in the image"));
}

TEST_CASE("polygons of one picture share no pixel", "[lint]") {
  const auto square = [](double x, double y, double size) {
    return std::vector<Vec2>{{x, y}, {x + size, y}, {x + size, y + size}, {x, y + size}};
  };
  PolygonParts parts(20, 10);
  const auto add = [&](const std::vector<Vec2>& polygon) {
    const CoverageMask mask = mask_of_polygons({polygon}, 20, 10);
    parts.add(mask);
    return pixel_count(mask);
  };
  CHECK(add(square(1, 1, 6)) == 36);
  CHECK(add(square(2, 3, 2)) == 4);  // seen through a hole
  CHECK(parts.contested() == 0);
  CHECK(add(square(6, 5, 3)) == 9);
  CHECK(parts.contested() == 2);
  CHECK(add(square(18, 8, 5)) == 4);
  CHECK(parts.contested() == 2);
}

TEST_CASE("keypoints off their corners are found", "[lint]") {
  for (const char* format : {"pose", "pose_centerpose"}) {
    const LintReport report = lint_with_pose(format, [](Json& object) {
      Json& pixels = object.contains("projected_cuboid") ? object["projected_cuboid"]
                                                         : object["cuboid_keypoints_projected"];
      pixels[3][0] = pixels[3][0].get<int>() + 2;
    });
    CHECK(has_finding(report, "keypoints project onto their pixels"));
  }
}

TEST_CASE("swapped axes of a place are found", "[lint]") {
  expect_found({"basic", "basic_raw", "bop", "kitti", "webdataset", "hdf5"},
               "pose and camera reproject onto the mask", [](Frame& frame) {
                 Affine& pose = seen(frame, "/Assets/ball").world_from_node;
                 std::swap(pose.translation().x(), pose.translation().y());
               });
  expect_found({"basic", "basic_raw", "bop", "webdataset", "hdf5"}, "depth back-projects",
               [](Frame& frame) {
                 Affine& pose = seen(frame, "/Assets/crate").world_from_node;
                 pose.linear().col(0).swap(pose.linear().col(1));
               });
  for (const char* format : {"pose", "pose_centerpose", "pose_dope"}) {
    INFO(format);
    const LintReport report = lint_with_pose(format, [](Json& object) {
      const char* full[] = {"location_camera_frame", "location"};
      Json& place = object.contains(full[0]) ? object[full[0]] : object[full[1]];
      std::swap(place[1], place[2]);
    });
    CHECK(has_finding(report, "pose agrees with the keypoints"));
  }
}

TEST_CASE("the wrong kind of depth is found in every format that has depth", "[lint]") {
  expect_found({"basic", "basic_raw", "bop", "webdataset", "hdf5"}, "depth back-projects",
               [](Frame& frame) {
                 frame.set(kDistanceToImagePlane, Image<float>(frame.get(kDistanceToCamera)));
               });
}

TEST_CASE("motion in a clip is the flow to the last frame, turned round", "[lint]") {
  const auto findings = [](int frame_of_clip, const Vec2f& moved, const Vec2f& beyond) {
    StoredCapture stored;
    stored.capture.clip = ClipFrame{0, frame_of_clip, 2, 10.0};
    Frame& frame = stored.capture.frames.emplace_back();
    frame.camera.width = 2;
    frame.camera.height = 1;
    Image<float> distance(2, 1, 1.5f);
    distance.at(1, 0) = std::numeric_limits<float>::infinity();
    Image<Vec2f> flow(2, 1, Vec2f(3.0f, -2.0f));
    flow.at(1, 0) = Vec2f::Zero();
    Image<std::uint32_t> states(2, 1, std::uint32_t(FlowState::Seen));
    states.at(1, 0) = std::uint32_t(FlowState::Unknown);
    Image<Vec2f> motion(2, 1, moved);
    motion.at(1, 0) = beyond;
    frame.set(kDistanceToCamera, std::move(distance));
    frame.set(kFlowBackward, std::move(flow));
    frame.set(kFlowBackwardState, std::move(states));
    frame.set(kMotion, std::move(motion));
    check_frames(StoredInfo(), stored);
    std::vector<std::string> found;
    for (const Finding& finding : stored.log.findings) found.push_back(finding.found);
    return found;
  };
  using Found = std::vector<std::string>;
  const Vec2f none = Vec2f::Zero();
  CHECK(findings(1, {-3.0f, 2.0f}, none).empty());
  CHECK(findings(0, none, none).empty());
  CHECK(findings(1, {-2.0f, 2.0f}, none) == Found{"1 pixels have moved otherwise"});
  CHECK(findings(1, {-3.0f, 2.0f}, {1.0f, 0.0f}) ==
        Found{"1 pixels move in which nothing was hit"});
  CHECK(findings(0, {1.0f, 0.0f}, none) == Found{"1 pixels have moved where a clip begins"});
}

TEST_CASE("the wrong order of a quaternion is found in every format that has one", "[lint]") {
  for (const char* format : {"pose", "pose_centerpose", "pose_dope"}) {
    INFO(format);
    const LintReport report = lint_with_pose(format, [](Json& object) {
      Json& q = object.contains("quaternion_xyzw") ? object["quaternion_xyzw"]
                                                   : object["quat_wxyz_camera_frame"];
      q = Json{q[3], q[0], q[1], q[2]};
    });
    CHECK(has_finding(report, "pose agrees with the keypoints"));
  }
}

TEST_CASE("bytes damaged anywhere in a container give findings or nothing, never a crash",
          "[lint]") {
  for (const std::string name : {"hdf5", "webdataset"}) {
    const auto dataset = write(format_named(name), capture_through(LensModel::Pinhole));
    const std::string file = name == "hdf5" ? "train/000000_cam_0.hdf5" : "shards/000000.tar";
    const std::string content = dataset.read(file);
    int found = 0;
    // Headers and trees lie at the front.
    for (std::size_t at = 0; at < content.size(); at += at < 3000 ? 7 : 211) {
      std::string damaged = content;
      damaged[at] = char(damaged[at] ^ 0xA5);
      dataset.write(file, damaged);
      if (!dataset.lint().findings.empty()) ++found;
    }
    CHECK(found > 50);
  }
}
