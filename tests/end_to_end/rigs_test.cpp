// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <nlohmann/json.hpp>

#include "numpy_files.h"
#include "program.h"
#include "replicator_camera.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

constexpr double kBaseline = 0.09;

const std::string kRigJob = R"(
seed: 3
total_captures: 6
environments: [{type: shapes, shapes: [cube, sphere]}]
objects:
  - {type: shapes, name: targets, under: /Assets, count: 8, balance: true, label_pattern: "^"}
cameras:
  - type: pinhole
    name: stereo
    width: 120
    height: 80
    rig:
      - {name: left}
      - {name: right, position: [0.09, 0, 0]}
      - {name: depth, position: [0.045, 0.02, 0], rotation_deg: [0, 0, 10], width: 64, height: 64}
lights: [{type: dome, name: sky}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*", scale: [0.1, 0.2],
     offset: [[-0.8, 0.8], [-0.8, 0.8], [1.1, 2.0]]}
  - {type: orbit_cameras, name: view, on: [still], targets: "/Assets/*", distance: [0.6, 2.0],
     polar_angle_deg: [10, 120]}
physics: {type: none}
renderer: {type: "null"}
timeline: [{capture: still, count: 3}]
views:
  - {name: seen, targets: "/Assets/*", visible_pixels: {min: 25}, max_tries: 2000}
writers:
  - {type: BasicWriter, name: basic, distance_to_image_plane: true, camera_params: true,
     bounding_box_2d_tight: true}
)";

class RigOutput {
 public:
  RigOutput() {
    write_file(folder_ / "rig.yaml", kRigJob);
    const Outcome outcome = run({"run", "rig.yaml", "--output", "out"}, folder_.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
    files_ = tree(folder_ / "out");
  }
  const std::string& file(const std::string& name) const { return files_.at(name); }
  /// By camera and the end of its name.
  const std::string& of(const std::string& camera, const std::string& end) const {
    for (const auto& [name, text] : files_) {
      if (name.find("rp_stereo_0_" + camera) != std::string::npos && name.ends_with(end))
        return text;
    }
    throw std::runtime_error("no file " + end + " of " + camera);
  }
  ReplicatorCamera camera(const std::string& name, int capture) const {
    return camera_of(Json::parse(of(name, "camera_params_" + number(capture) + ".json")));
  }
  NpyArray depth(const std::string& name, int capture) const {
    return parse_npy(of(name, "distance_to_image_plane_" + number(capture) + ".npy"));
  }
  static std::string number(int capture) { return "000" + std::to_string(capture); }
  const fs::path& folder() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
  std::map<std::string, std::string> files_;
};

}  // namespace

TEST_CASE("A rig's cameras are placed together, and a stereo pair has its disparity", "[run]") {
  const RigOutput output;
  std::size_t compared = 0;
  std::size_t agreeing = 0;
  for (int capture = 0; capture < 6; ++capture) {
    const ReplicatorCamera left = output.camera("left", capture);
    const ReplicatorCamera right = output.camera("right", capture);
    const ReplicatorCamera depth = output.camera("depth", capture);
    // x right, y down, z forward.
    const Affine right_from_left = right.camera_from_world * left.camera_from_world.inverse();
    CHECK((right_from_left.translation() - Vec3(-kBaseline, 0, 0)).norm() < 1e-5);
    CHECK((right_from_left.linear() - Mat3::Identity()).norm() < 1e-5);
    const Affine left_from_depth = left.camera_from_world * depth.camera_from_world.inverse();
    CHECK((left_from_depth.translation() - Vec3(0.045, -0.02, 0)).norm() < 1e-5);
    CHECK(Eigen::AngleAxisd(left_from_depth.linear()).angle() * 180.0 / kPi == Approx(10.0));
    CHECK(depth.lens.width == 64);
    const NpyArray a = output.depth("left", capture);
    const NpyArray b = output.depth("right", capture);
    for (int y = 0; y < 80; ++y) {
      for (int x = 0; x < 120; ++x) {
        const auto at = [&](const NpyArray& array, int column) {
          return double(array.value<float>(4 * std::size_t(y * 120 + column)));
        };
        const double z = at(a, x);
        if (!std::isfinite(z)) continue;
        const double match = x + 0.5 - left.lens.focal.x() * kBaseline / z;
        if (match < 1.0 || match >= 119.0) continue;
        ++compared;
        const double other = at(b, int(std::floor(match)));
        // Edges, and what one camera sees past, differ.
        if (std::abs(other - z) < 0.02 * z) ++agreeing;
      }
    }
  }
  CHECK(compared > 2000);
  CHECK(double(agreeing) > 0.9 * double(compared));
}

TEST_CASE("Extrinsics of a rig stand in dataset.json, and views speak of each of its cameras",
          "[run]") {
  const RigOutput output;
  const Json page = Json::parse(output.file("dataset.json"));
  CHECK(page["cameras"] == Json::array({"stereo_0_left", "stereo_0_right", "stereo_0_depth"}));
  const Json& rig = page["rigs"]["stereo_0"];
  REQUIRE(rig.size() == 3);
  CHECK(rig[1]["camera"] == "stereo_0_right");
  CHECK(rig[1]["rig_from_camera"][0][3] == 0.09);
  CHECK(rig[0]["rig_from_camera"] == Json::parse("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"));
  const Json views = Json::parse(output.file("views.json"));
  CHECK(views["views"] == 18);
  CHECK(views["unmet"].empty());
  CHECK(run({"lint", "out"}, output.folder()).exit_code == 0);
}
