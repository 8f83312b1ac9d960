// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/fake_host.h"
#include "scatter_lights.h"
#include "scatter_poses.h"
#include "support/catch.h"
#include "support/statistics.h"

using namespace diorama;
using namespace diorama::test;

namespace {

struct Stage {
  FakeHost host;
  Scene scene;
  RandomizeContext context{"environment", -1, Vec3(3.0, -2.0, 0.5)};
  NodeId group(const std::string& name) { return scene.create(scene.root(), name); }
};

double scale_of(const Affine& pose) { return std::cbrt(pose.linear().determinant()); }

}  // namespace

TEST_CASE("scattered poses fill their box, their scales and all rotations evenly",
          "[randomizers]") {
  Stage stage;
  const NodeId asset = stage.scene.create(stage.group("Assets"), "falling_mug");
  ScatterPoses::Params params;
  params.offset = Distribution::between({-0.5, -0.25, 1.0}, {0.5, 0.75, 1.5});
  params.scale = Range{0.95, 1.15};
  ScatterPoses scatter(params, stage.host);
  std::vector<double> x, y, z, scale, heading, tilt;
  for (int seed = 0; seed < kSeeds; ++seed) {
    scatter.randomize(stage.scene, stage.context, Rng(std::uint64_t(seed)));
    const Affine pose = stage.scene.world_from_node(asset);
    x.push_back(pose.translation().x());
    y.push_back(pose.translation().y());
    z.push_back(pose.translation().z());
    scale.push_back(scale_of(pose));
    // Uniform on SO(3): the z axis is uniform on the sphere, so its height and its heading are
    // flat.
    const Vec3 up = pose.linear().col(2).normalized();
    tilt.push_back(up.z());
    heading.push_back(std::atan2(up.y(), up.x()));
  }
  CHECK(fills(x, 2.5, 3.5));
  CHECK(fills(y, -2.25, -1.25));
  CHECK(fills(z, 1.5, 2.0));
  CHECK(fills(scale, 0.95, 1.15));
  CHECK(fills(tilt, -1.0, 1.0));
  CHECK(fills(heading, -kPi, kPi));
}

TEST_CASE("offsets are the world's even below a moved parent", "[randomizers]") {
  Stage stage;
  const NodeId parent = stage.group("Assets");
  Transform pose;
  pose.translation = Vec3(10, 20, 30);
  pose.rotation = Quat(Eigen::AngleAxisd(1.0, Vec3(1, 2, 3).normalized()));
  pose.scale = Vec3::Constant(0.01);
  stage.scene.set_pose(parent, pose);
  const NodeId asset = stage.scene.create(parent, "mug");
  ScatterPoses::Params params;
  params.offset = Vec3(1, 2, 3);
  params.scale = Range{2.0, 2.0};
  ScatterPoses(params, stage.host).randomize(stage.scene, stage.context, Rng(1));
  const Affine world = stage.scene.world_from_node(asset);
  CHECK((world.translation() - Vec3(4, 0, 3.5)).norm() < 1e-9);
  CHECK(scale_of(world) == Approx(2.0));
}

TEST_CASE("one more node leaves the draws of the others as they were", "[randomizers]") {
  const auto poses = [](bool with_more) {
    Stage stage;
    const NodeId assets = stage.group("Assets");
    if (with_more) stage.scene.create(assets, "apple");
    const NodeId mug = stage.scene.create(assets, "mug");
    const NodeId bowl = stage.scene.create(assets, "bowl");
    ScatterPoses({}, stage.host).randomize(stage.scene, stage.context, Rng(7));
    Eigen::Matrix<double, 4, 8> both;
    both << stage.scene.world_from_node(mug).matrix(), stage.scene.world_from_node(bowl).matrix();
    return both;
  };
  CHECK(poses(true) == poses(false));
  CHECK(poses(false).leftCols<4>() != poses(false).rightCols<4>());
}

TEST_CASE("upright and euler rotations keep to their angles", "[randomizers]") {
  Stage stage;
  const NodeId asset = stage.scene.create(stage.group("Assets"), "chair");
  ScatterPoses::Params params;
  params.rotation = "upright";
  params.rotation_deg = Range{10.0, 80.0};
  ScatterPoses upright(params, stage.host);
  std::vector<double> angles;
  for (int seed = 0; seed < kSeeds; ++seed) {
    upright.randomize(stage.scene, stage.context, Rng(std::uint64_t(seed)));
    const Mat3 rotation = stage.scene.world_from_node(asset).linear();
    CHECK(rotation(2, 2) == Approx(1.0));
    angles.push_back(std::atan2(rotation(1, 0), rotation(0, 0)) * 180.0 / kPi);
  }
  CHECK(fills(angles, 10.0, 80.0));
  params.rotation = "none";
  ScatterPoses(params, stage.host).randomize(stage.scene, stage.context, Rng(3));
  CHECK(stage.scene.world_from_node(asset).linear() == Mat3::Identity());
  params.rotation = "euler";
  params.rotation_deg = Range{90.0, 90.0};
  ScatterPoses(params, stage.host).randomize(stage.scene, stage.context, Rng(3));
  // About x, then y, then z, all by a quarter: x -> -z, y -> y, z -> x.
  Mat3 expected;
  expected << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  CHECK((stage.scene.world_from_node(asset).linear() - expected).norm() < 1e-12);
}

TEST_CASE("scattered lights fill box, colour and intensity, and spare other lights",
          "[randomizers]") {
  Stage stage;
  const NodeId lights = stage.group("Lights");
  const NodeId lamp = stage.scene.create(lights, "scene_0");
  const NodeId dome = stage.scene.create(lights, "sky_0");
  stage.scene.edit(lamp).light = Light{};
  stage.scene.edit(dome).light = Light{};
  stage.scene.edit(dome).light->kind = LightKind::Dome;
  ScatterLights::Params params;
  params.intensity = Range{500, 2500};
  params.color = Distribution::between({0.4, 0.5, 0.25}, {1.0, 0.5, 0.25});
  params.radius_m = Range{0.1, 0.3};
  ScatterLights scatter(params, stage.host);
  std::vector<double> z, red, intensity, radius;
  for (int seed = 0; seed < kSeeds; ++seed) {
    scatter.randomize(stage.scene, stage.context, Rng(std::uint64_t(seed)));
    const Light& light = *stage.scene[lamp].light;
    z.push_back(stage.scene.world_from_node(lamp).translation().z());
    intensity.push_back(light.color.y() / 0.5);
    red.push_back(light.color.x() / (light.color.y() / 0.5));
    CHECK(light.color.z() == Approx(0.5 * light.color.y()));
    radius.push_back(light.radius_m);
  }
  CHECK(fills(z, 1.5, 3.5));
  CHECK(extent_of(intensity).lo >= 499.99);
  CHECK(fills(intensity, 500 - 1e-3, 2500 + 1e-3));
  CHECK(fills(red, 0.4 - 1e-6, 1.0 + 1e-6));
  CHECK(fills(radius, 0.1, 0.3));
  CHECK(stage.scene.world_from_node(dome).matrix() == Mat4::Identity());
  CHECK(stage.scene[dome].light->color == Light{}.color);
  params.radius_m.reset();
  stage.scene.edit(lamp).light->radius_m = 0.77;
  ScatterLights(params, stage.host).randomize(stage.scene, stage.context, Rng(1));
  CHECK(stage.scene[lamp].light->radius_m == 0.77);
}
