// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "numpy_files.h"
#include "program.h"
#include "replicator_camera.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// Everything in the air: turning, falling, and what floats.
std::string falling_job(int steps) {
  return R"(
seed: 11
total_captures: 1
environments: [{type: shapes, shapes: [cube]}]
environment: {colliders: triangle_mesh}
objects:
  - {type: shapes, name: things, under: /Assets, count: 6, label_pattern: "^", gravity_disabled_chance: 0.3}
lights: [{type: dome, name: sky}]
cameras: [{type: pinhole, name: cam, count: 1, width: 96, height: 72}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.6, 0.6], [-0.6, 0.6], [1.4, 2.0]], scale: [0.1, 0.2]}
  - {type: orbit_cameras, name: cameras, on: [environment], nodes: "/Cameras/*",
     targets: "/Environment", distance: [3.0, 3.0], polar_angle_deg: [40, 40]}
settle: {policy: keep}
renderer: {type: "null"}
timeline: [{simulate: )" +
         std::to_string(steps) + R"(}, {capture: falling, count: 1}]
writers:
  - {type: BasicWriter, name: basic, instance_segmentation: true, colorize_instance_segmentation: false,
     bounding_box_3d: true, camera_params: true, pointcloud: true, motion_vectors: true}
output: {folder: out}
)";
}

class FallOutput {
 public:
  explicit FallOutput(int steps) {
    write_file(folder_ / "job.yaml", falling_job(steps));
    const Outcome outcome = run({"run", "job.yaml"}, folder_.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
  }
  std::string file(const std::string& name) const {
    return read_file(folder_ / "out/basic" / name);
  }
  NpyArray array(const std::string& name) const { return parse_npy(file(name)); }
  /// World from local, by path.
  std::map<std::string, Affine> poses() const {
    const NpyArray boxes = array("bounding_box_3d_0000.npy");
    const Json paths = Json::parse(file("bounding_box_3d_prim_paths_0000.json"));
    std::map<std::string, Affine> poses;
    for (std::size_t row = 0; row < paths.size(); ++row) {
      Affine pose;
      for (std::size_t i = 0; i < 16; ++i) {
        pose.matrix()(Eigen::Index(i % 4), Eigen::Index(i / 4)) =
            boxes.value<float>(96 * row + 28 + 4 * i);
      }
      poses.emplace(paths[row].get<std::string>(), pose);
    }
    return poses;
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace

TEST_CASE("motion vectors are what the last step moved", "[run]") {
  const FallOutput before(14);
  const FallOutput now(15);
  const auto earlier_poses = before.poses();
  const auto poses = now.poses();
  const auto camera = camera_of(Json::parse(now.file("camera_params_0000.json")));
  const auto ids =
      parse_picture(now.file("instance_segmentation_0000.png"), "instance_segmentation");
  const Json paths = Json::parse(now.file("instance_segmentation_mapping_0000.json"));
  const NpyArray motion = now.array("motion_vectors_0000.npy");
  const NpyArray points = now.array("pointcloud_0000.npy");
  std::size_t point = 0;
  int moving = 0;
  double worst = 0.0;
  for (int y = 0; y < ids.height; ++y) {
    for (int x = 0; x < ids.width; ++x) {
      const std::size_t at = 16 * std::size_t(y * ids.width + x);
      const Vec2 found(-motion.value<float>(at), -motion.value<float>(at + 4));
      const std::string path = paths.value(std::to_string(ids.packed(x, y)), "");
      if (!poses.contains(path)) {
        worst = std::max(worst, found.norm());
        continue;
      }
      Vec3 place;
      for (std::size_t k = 0; k < 3; ++k) {
        place[Eigen::Index(k)] = points.value<float>(12 * point + 4 * k);
      }
      ++point;
      const Vec3 earlier = earlier_poses.at(path) * (poses.at(path).inverse() * place);
      const Vec2 expected = *camera.lens.pixel(camera.camera_from_world * place) -
                            *camera.lens.pixel(camera.camera_from_world * earlier);
      if (expected.norm() > 0.5) ++moving;
      worst = std::max(worst, (found - expected).norm());
    }
  }
  CHECK(point == points.data.size() / 12);
  CHECK(moving > 50);
  CHECK(worst < 0.01);
}
