// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/second_opinion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "diorama/camera.h"
#include "framework/datasets/frame_checks.h"
#include "framework/lint/dataset_on_disk.h"
#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "framework/lint/lint_report.h"
#include "framework/lint/opencv_geometry.h"
#include "plugins/writer_support/sample_capture.h"
#include "support/catch.h"
#include "writer_basic/basic_writer.h"
#include "writer_bop/bop_writer.h"
#include "writer_hdf5/hdf5_writer.h"
#include "writer_webdataset/webdataset_writer.h"

using namespace diorama;

namespace {

constexpr const char* kSurface = "surfaces project onto their pixels";
constexpr const char* kReach = "3-D box reaches no farther than its object";

Camera camera_with(LensModel lens) {
  Camera camera;
  camera.width = 300;
  camera.height = 200;
  camera.fx = 240.0;
  camera.fy = lens == LensModel::FisheyePolynomial ? 240.0 : 250.0;
  camera.cx = 161.0;
  camera.cy = 93.0;
  camera.lens = lens;
  camera.distortion = {-0.1, 0.02, 0.001, -0.002, 0.01, 0.02, -0.01, 0.003};
  camera.fisheye_polynomial = {0.0, 0.95 / camera.fx, 0.0, 2e-9, 0.0, 0.0};
  camera.fisheye_max_angle_rad = 1.3;
  return camera;
}

Capture sample_through(LensModel lens) {
  test::SampleScene sample(220, 150, 2);
  for (const NodeId node : sample.cameras) {
    Camera& camera = *sample.scene.edit(node).camera;
    camera.lens = lens;
    camera.distortion = {-0.1, 0.02, 0.001, -0.002, 0.01, 0.02, -0.01, 0.003};
    camera.fisheye_polynomial = {0.0, 0.95 / camera.fx, 1e-6, 0.0, 0.0, 0.0};
    camera.fisheye_max_angle_rad = 1.3;
  }
  return test::ray_cast_capture(sample, 0);
}

StoredInfo everything_held() {
  StoredInfo info;
  for (const std::string_view name :
       {kHoldsInstances, kHoldsLabels, kHoldsNodePaths, kHoldsTightBoxes, kHoldsPoses, kHoldsBounds,
        kHoldsBoxes3d, kHoldsAmodalBoxes, kHoldsCamera, kHoldsCameraPose}) {
    info.holds.emplace(name);
  }
  return info;
}

/// What is found of the sample after a change; `also_others`: by lint's other checks, too.
std::vector<Finding> found_in(LensModel lens, const std::function<void(Frame&)>& spoil,
                              bool also_others = false) {
  StoredCapture stored;
  stored.capture = sample_through(lens);
  for (Frame& frame : stored.capture.frames) {
    REQUIRE(frame.has(kPosition.name));
    REQUIRE(frame.has(kObjectCoordinates.name));
    spoil(frame);
    stored.files.emplace_back();
  }
  const StoredInfo info = everything_held();
  if (also_others) {
    check_frames(info, stored);
  } else {
    check_second_opinion(info, stored);
  }
  return stored.log.findings;
}

Instance& crate(Frame& frame) {
  return *std::ranges::find(frame.instances, "/Assets/crate", &Instance::node_path);
}

void turn_crate(Frame& frame) {
  const Vec3 centre = crate(frame).bounds_node.centre();
  Affine turn = Affine::Identity();
  turn.translate(centre).rotate(Eigen::AngleAxisd(kPi, Vec3::UnitZ())).translate(-centre);
  crate(frame).world_from_node = crate(frame).world_from_node * turn;
}

template <class W>
LintReport lint_written(const typename W::Params& params, const Capture& capture) {
  test::EncodingHost host;
  W writer(params, host);
  DatasetInfo dataset = test::sample_dataset(test::SampleScene(8, 6));
  dataset.capture_count = 1;
  return test::DatasetOnDisk(test::write_dataset(writer, dataset, {&capture})).lint();
}

bool has(const LintReport& report, const char* check) {
  return std::ranges::count(report.findings, check, &LintFinding::check) > 0;
}

bool has(const std::vector<Finding>& findings, const char* check) {
  return std::ranges::count(findings, check, &Finding::check) > 0;
}

}  // namespace

TEST_CASE("OpenCV and the formulas of lint and of the SDK see points at the same pixels",
          "[lint][opinion]") {
  const LensModel model =
      GENERATE(LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial);
  const Camera camera = camera_with(model);
  const lint::Lens lens = lint::lens_of(camera);
  std::vector<Vec3> points;
  for (int i = -4; i <= 4; ++i) {
    for (int j = -3; j <= 3; ++j)
      points.emplace_back(0.13 * i, 0.11 * j, 1.0 + 0.1 * ((i + j) % 3));
  }
  const auto pixels = lint::opencv_geometry().project(lens, points);
  const double slack = model == LensModel::FisheyePolynomial ? 0.1 : 1e-6;
  for (std::size_t i = 0; i < points.size(); ++i) {
    REQUIRE(pixels[i]);
    CHECK((*pixels[i] - *lens.pixel(points[i])).norm() < slack);
    const Vec3 sdk_point = points[i].cwiseProduct(Vec3(1.0, -1.0, -1.0));
    CHECK((*pixels[i] - *project(camera, sdk_point)).norm() < slack);
  }
  CHECK_FALSE(lint::opencv_geometry().project(lens, std::array{Vec3(0.1, 0.2, -1.0)})[0]);
}

TEST_CASE("a pose is found from points and their pixels", "[lint][opinion]") {
  const LensModel model =
      GENERATE(LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial);
  const lint::Lens lens = lint::lens_of(camera_with(model));
  Affine camera_from_local = Affine::Identity();
  camera_from_local.linear() =
      Eigen::AngleAxisd(2.1, Vec3(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
  camera_from_local.translation() = Vec3(0.1, -0.05, 1.2);
  std::vector<Vec3> points;
  std::vector<Vec2> pixels;
  for (int i = 0; i < 20; ++i) {
    points.emplace_back(0.1 * std::sin(i * 1.7), 0.15 * std::cos(i * 2.3),
                        0.12 * std::sin(i * 0.9));
    pixels.push_back(*lens.pixel(camera_from_local * points.back()));
  }
  const auto solved = lint::opencv_geometry().solve_pose(lens, points, pixels);
  REQUIRE(solved);
  CHECK((solved->matrix() - camera_from_local.matrix()).cwiseAbs().maxCoeff() < 5e-3);
  CHECK_FALSE(lint::opencv_geometry().solve_pose(lens, std::span(points).first(5),
                                                 std::span(pixels).first(5)));
}

TEST_CASE("lenses that OpenCV's model cannot follow get no opinion", "[lint][opinion]") {
  lint::Lens lens = lint::lens_of(camera_with(LensModel::FisheyePolynomial));
  lens.polynomial = {0.1, 0.004, 0.0, 0.0, 0.0, 0.0};
  CHECK_FALSE(lint::opencv_geometry().project(lens, std::array{Vec3(0.0, 0.1, 1.0)})[0]);
  lens.polynomial = {0.0, -0.004, 0.0, 0.0, 0.0, 0.0};
  CHECK_FALSE(lint::opencv_geometry().project(lens, std::array{Vec3(0.0, 0.1, 1.0)})[0]);
  lens.polynomial = {0.0, 0.004, 0.0, -1e-6, 0.0, 0.0};  // turns back inside the picture
  CHECK_FALSE(lint::opencv_geometry().project(lens, std::array{Vec3(0.0, 0.1, 1.0)})[0]);
}

TEST_CASE("right poses have no second opinion against them, through any lens", "[lint][opinion]") {
  const LensModel lens =
      GENERATE(LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial);
  for (const Finding& finding : found_in(lens, [](Frame&) {})) {
    FAIL_CHECK(finding.check << ": " << finding.object << " " << finding.found);
  }
}

TEST_CASE("wrong poses that other checks pass are found by OpenCV's projection",
          "[lint][opinion]") {
  const LensModel lens =
      GENERATE(LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial);
  CAPTURE(int(lens));
  SECTION("a box that is turned round half a turn looks the same") {
    CHECK(found_in(lens, turn_crate, true).empty());
    const auto findings = found_in(lens, turn_crate);
    REQUIRE(has(findings, kSurface));
    CHECK(findings[0].object == "/Assets/crate");
    CHECK_THAT(findings[0].found, ContainsSubstring("pixels of object_coordinates show what"));
    CHECK_THAT(findings[0].expected, ContainsSubstring("seen from a camera turned by"));
  }
  SECTION("a camera that stands elsewhere") {
    const auto spoil = [](Frame& frame) {
      frame.instances.clear();
      frame.world_from_camera.translation() += Vec3(0.03, 0.0, 0.02);
    };
    const auto findings = found_in(lens, spoil);
    REQUIRE(has(findings, kSurface));
    CHECK_THAT(findings[0].found, ContainsSubstring("pixels of position show what"));
    // sqrt(0.03^2 + 0.02^2)
    CHECK_THAT(findings[0].expected, ContainsSubstring("and 0.036"));
  }
  SECTION("a 3-D box that is too large") {
    // What the pinholes show of it leaves the picture or lies within the slack.
    if (lens == LensModel::Pinhole) return;
    const auto spoil = [](Frame& frame) {
      Aabb& bounds = crate(frame).bounds_node;
      bounds.max.x() += 1.2 * bounds.size().x();
    };
    CHECK(found_in(lens, spoil, true).empty());
    CHECK(has(found_in(lens, spoil), kReach));
  }
}

TEST_CASE("poses are checked in files that hold positions and object coordinates",
          "[lint][opinion]") {
  WebDatasetWriter::Params web;
  web.channels.names = {std::string(kPosition.name), std::string(kObjectCoordinates.name)};
  web.depth = web.instances = true;
  Hdf5Writer::Params hdf5;
  hdf5.channels.names = web.channels.names;
  for (const LensModel lens :
       {LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial}) {
    CAPTURE(int(lens));
    Capture capture = sample_through(lens);
    for (const LintReport& report :
         {lint_written<WebDatasetWriter>(web, capture), lint_written<Hdf5Writer>(hdf5, capture)}) {
      INFO(lint_text(report));
      CHECK(report.findings.empty());
    }
    for (Frame& frame : capture.frames) turn_crate(frame);
    for (const LintReport& report :
         {lint_written<WebDatasetWriter>(web, capture), lint_written<Hdf5Writer>(hdf5, capture)}) {
      INFO(lint_text(report));
      CHECK(has(report, kSurface));
    }
  }
}

TEST_CASE("3-D boxes that are too large are found in files that hold them", "[lint][opinion]") {
  // Along its y axis the crate's box grows within the slack, or out of the picture.
  for (const int axis : {0, 2}) {
    CAPTURE(axis);
    Capture capture = sample_through(LensModel::OpencvPinhole);
    for (Frame& frame : capture.frames) {
      Aabb& bounds = crate(frame).bounds_node;
      bounds.max[axis] += 1.2 * bounds.size()[axis];
    }
    for (const LintReport& report : {lint_written<BopWriter>({}, capture),
                                     lint_written<BasicWriter>(test::everything(), capture)}) {
      INFO(lint_text(report));
      CHECK(has(report, kReach));
      CHECK(report.findings.size() == 1);
    }
  }
}
