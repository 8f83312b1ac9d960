// SPDX-License-Identifier: Apache-2.0
#include "diorama/obstacles.h"
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
  RandomizeContext context{"environment", -1, Vec3(3.0, -2.0, 0.5), 0, {}};
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

namespace {

/// A floor, a table of 1 x 1 x 1 m at (3, -2) and objects that wait at the origin, which is in the
/// middle of a pillar that is not to matter to them.
struct Furnished : Stage {
  explicit Furnished(int objects) {
    const NodeId room = group("Environment");
    add(room, "floor", make_box(Vec3(20, 20, 0.1)), Vec3(0, 0, -0.05));
    add(room, "table", make_box(Vec3(1, 1, 1)), Vec3(3, -2, 0.5));
    const NodeId assets = group("Assets");
    for (int i = 0; i < objects; ++i) {
      const NodeId node = add(assets, "box", make_box(Vec3(0.3, 0.1, 0.05)), Vec3::Zero());
      scene.edit(node).rigid_body = RigidBody{};
      nodes.push_back(node);
    }
  }
  NodeId add(NodeId parent, const std::string& name, const Mesh& mesh, const Vec3& place) {
    const NodeId node = scene.create(parent, name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(mesh);
    scene.set_pose(node, Affine(Eigen::Translation3d(place)));
    return node;
  }
  int overlaps() const {
    const Obstacles all(scene, scene.match("/*/*"), Obstacles::Hidden::Count);
    int count = 0;
    for (const NodeId node : nodes) {
      const bool meets = !all.near_node(scene, node, 0.0).empty() ||
                         all.encloser(scene.world_bounds(node).centre(), node);
      count += meets ? 1 : 0;
    }
    return count;
  }
  std::vector<NodeId> nodes;
};

}  // namespace

TEST_CASE("Scattered things start neither in furniture nor in each other", "[randomizers]") {
  ScatterPoses::Params params;
  // The table's upper half is within reach.
  params.offset = Distribution::between({-0.6, -0.6, -0.2}, {0.6, 0.6, 1.0});
  params.scale = Range{0.8, 1.2};
  Furnished stage(40);
  ScatterPoses(params, stage.host).randomize(stage.scene, stage.context, Rng(5));
  CHECK(stage.overlaps() == 0);
  CHECK(stage.host.warnings.empty());
  std::vector<double> scales;
  for (const NodeId node : stage.nodes) {
    scales.push_back(scale_of(stage.scene.world_from_node(node)));
  }

  Furnished blind(40);
  params.avoid_overlap = false;
  ScatterPoses(params, blind.host).randomize(blind.scene, blind.context, Rng(5));
  CHECK(blind.overlaps() > 10);
  // Only places are drawn again.
  for (std::size_t i = 0; i < blind.nodes.size(); ++i) {
    CHECK(scale_of(blind.scene.world_from_node(blind.nodes[i])) == Approx(scales[i]));
  }
}

TEST_CASE("What waits to be placed is in nobody's way, what is placed is", "[randomizers]") {
  Furnished stage(1);
  const NodeId other =
      stage.add(stage.scene.find("/Assets"), "crate", make_box(Vec3(4, 4, 4)), Vec3::Zero());
  stage.scene.edit(other).rigid_body = RigidBody{};
  ScatterPoses::Params params;
  params.nodes = "/Assets/box";
  params.offset = Vec3(-3, 2, 0.5);  // (0, 0, 1): inside of the crate that waits
  ScatterPoses scatter(params, stage.host);
  scatter.randomize(stage.scene, stage.context, Rng(1));
  CHECK(stage.host.warnings.empty());
  stage.scene.set_pose(other, Affine(Eigen::Translation3d(0, 0, 2.5)));
  scatter.randomize(stage.scene, stage.context, Rng(1));
  REQUIRE(stage.host.warnings.size() == 1);
  CHECK_THAT(stage.host.warnings[0], ContainsSubstring("1 of 1 nodes that fit '/Assets/box'"));
}

TEST_CASE("Lights stay off surfaces and in front of walls", "[randomizers]") {
  Furnished stage(0);
  stage.add(stage.scene.find("/Environment"), "wall", make_box(Vec3(0.1, 20, 6)), Vec3(4.2, 0, 3));
  const NodeId lamp = stage.scene.create(stage.group("Lights"), "lamp");
  stage.scene.edit(lamp).light = Light{};
  stage.scene.edit(lamp).light->radius_m = 0.1;
  ScatterLights::Params params;
  params.offset = Distribution::between({-2, -2, 0}, {2, 2, 2});
  params.clearance_m = 0.4;
  ScatterLights scatter(params, stage.host);
  params.clearance_m = 0.0;
  ScatterLights blind(params, stage.host);
  const Obstacles things(stage.scene, "/Environment/**");
  int too_near = 0, behind = 0;
  for (int seed = 0; seed < 100; ++seed) {
    scatter.randomize(stage.scene, stage.context, Rng(std::uint64_t(seed)));
    const Vec3 place = stage.scene.world_from_node(lamp).translation();
    CHECK(things.distance(place, 1.0) >= 0.5);
    CHECK(place.x() < 4.2);
    blind.randomize(stage.scene, stage.context, Rng(std::uint64_t(seed)));
    const Vec3 anywhere = stage.scene.world_from_node(lamp).translation();
    too_near += things.distance(anywhere, 1.0) < 0.5 ? 1 : 0;
    behind += anywhere.x() > 4.2 ? 1 : 0;
  }
  CHECK(too_near > 10);
  CHECK(behind > 5);
}
