// SPDX-License-Identifier: Apache-2.0
#include <functional>

#include "collision_world.h"
#include "diorama/error.h"
#include "framework/pipeline/fake_host.h"
#include "scatter_2d.h"
#include "scatter_3d.h"
#include "support/catch.h"
#include "support/statistics.h"
#include "surface_points.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// A table of 2 x 1 x 0.8 m at (5, 1) on a floor, and cubes that wait at the origin.
struct Stage {
  explicit Stage(int cubes, double size = 0.1) {
    const NodeId room = scene.create(scene.root(), "Environment");
    const NodeId floor = scene.create(room, "floor");
    scene.edit(floor).mesh = std::make_shared<const Mesh>(make_box(Vec3(20, 20, 0.2)));
    scene.set_pose(floor, Affine(Eigen::Translation3d(0, 0, -0.1)));
    table = scene.create(room, "TableDining");
    const NodeId top = scene.create(table, "top");
    scene.edit(top).mesh = std::make_shared<const Mesh>(make_box(Vec3(2, 1, 0.8)));
    scene.set_pose(table, Affine(Eigen::Translation3d(5, 1, 0.4)));
    const NodeId assets = scene.create(scene.root(), "Assets");
    const auto cube = std::make_shared<const Mesh>(make_box(Vec3::Constant(size)));
    for (int i = 0; i < cubes; ++i) {
      nodes.push_back(scene.create(assets, "cube"));
      scene.edit(nodes.back()).mesh = cube;
      Transform pose;
      pose.rotation = Quat(Eigen::AngleAxisd(0.3 * i, Vec3::UnitZ()));
      scene.set_pose(nodes.back(), pose);
    }
  }
  Vec3 place(std::size_t i) const { return scene.world_from_node(nodes[i]).translation(); }
  /// Pairs of cubes that meet, and cubes that meet the room.
  int overlaps() const {
    int count = 0;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      CollisionWorld others;
      others.add(CollisionBody(scene, scene.find("/Environment")), Vec3::Zero());
      for (std::size_t k = 0; k < i; ++k) others.add(CollisionBody(scene, nodes[k]), Vec3::Zero());
      count += others.is_free(CollisionBody(scene, nodes[i]), Vec3::Zero()) ? 0 : 1;
    }
    return count;
  }

  FakeHost host;
  Scene scene;
  NodeId table;
  std::vector<NodeId> nodes;
};

std::string text_of(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("Points on surfaces are even by area and on faces that point up", "[placement]") {
  const Stage stage(0);
  const SurfacePoints points(stage.scene, "/Environment/TableDining/**", 0.2);
  std::vector<double> x, y;
  Rng rng(4);
  for (int i = 0; i < kSeeds; ++i) {
    const Vec3 point = points.draw(rng);
    CHECK(point.z() == Approx(0.8));
    x.push_back(point.x());
    y.push_back(point.y());
  }
  CHECK(fills(x, 4.0, 6.0));
  CHECK(fills(y, 0.5, 1.5));
  CHECK(SurfacePoints(stage.scene, "/Nothing", 0.2).is_empty());
}

TEST_CASE("Nodes stand on the surface without meeting each other", "[placement]") {
  Stage stage(30);
  Scatter2d::Params params;
  params.surfaces = "/Environment/**/TableDining*/**";
  Scatter2d(params, stage.host).randomize(stage.scene, {}, Rng(11));
  CHECK(stage.host.warnings.empty());
  CHECK(stage.overlaps() == 0);
  for (std::size_t i = 0; i < stage.nodes.size(); ++i) {
    CHECK(stage.place(i).z() == Approx(0.8 + 0.05 + 0.002));
    CHECK(std::abs(stage.place(i).x() - 5.0) <= 1.0);
    CHECK(std::abs(stage.place(i).y() - 1.0) <= 0.5);
    // The rotation is the one that it had.
    const Mat3 rotation = stage.scene.world_from_node(stage.nodes[i]).linear();
    const Mat3 before = Eigen::AngleAxisd(0.3 * double(i), Vec3::UnitZ()).toRotationMatrix();
    CHECK((rotation - before).norm() < 1e-9);
  }
}

TEST_CASE("Switched off, nodes do meet", "[placement]") {
  Stage stage(30);
  Scatter2d::Params params;
  params.surfaces = "/Environment/**/TableDining*/**";
  params.placement.avoid_overlap = false;
  Scatter2d(params, stage.host).randomize(stage.scene, {}, Rng(11));
  CHECK(stage.overlaps() > 0);
}

TEST_CASE("Nodes in a volume meet neither each other nor the room", "[placement]") {
  Stage stage(60);
  Scatter3d::Params params;
  // A box that the table's upper half reaches into.
  params.offset = Distribution::between({-1.0, -0.5, -0.4}, {1.0, 0.5, 0.4});
  RandomizeContext context;
  context.working_area_world = Vec3(5, 1, 0.8);
  Scatter3d(params, stage.host).randomize(stage.scene, context, Rng(2));
  CHECK(stage.host.warnings.empty());
  CHECK(stage.overlaps() == 0);
  for (std::size_t i = 0; i < stage.nodes.size(); ++i) CHECK(stage.place(i).z() > 0.8);
}

TEST_CASE("Volumes are filled evenly, also where two overlap, except for what is excluded",
          "[placement]") {
  Stage stage(1, 0.001);
  const NodeId marks = stage.scene.create(stage.scene.root(), "Marks");
  const auto add_box = [&](const char* name, const Vec3& size, const Vec3& place) {
    const NodeId node = stage.scene.create(marks, name);
    stage.scene.edit(node).mesh = std::make_shared<const Mesh>(make_box(size));
    stage.scene.edit(node).is_visible = false;
    stage.scene.set_pose(node, Affine(Eigen::Translation3d(place)));
  };
  // Together they fill x in [0, 3] with an overlap in [1, 2]; x in [2.5, 3] is left out.
  add_box("volume_a", Vec3(2, 1, 1), Vec3(1, 0, 3));
  add_box("volume_b", Vec3(2, 1, 1), Vec3(2, 0, 3));
  add_box("hole", Vec3(0.5, 1, 1), Vec3(2.75, 0, 3));
  Scatter3d::Params params;
  params.volumes = "/Marks/volume_*";
  params.excluded = "/Marks/hole";
  Scatter3d scatter(params, stage.host);
  std::vector<double> x, z;
  for (int seed = 0; seed < kSeeds; ++seed) {
    scatter.randomize(stage.scene, {}, Rng(std::uint64_t(seed)));
    x.push_back(stage.place(0).x());
    z.push_back(stage.place(0).z());
  }
  CHECK(fills(x, 0.0, 2.5));
  CHECK(fills(z, 2.5, 3.5));
}

TEST_CASE("Without a free place the node is named, and nothing hangs", "[placement]") {
  Stage stage(3, 0.9);
  Scatter3d::Params params;
  params.offset = Distribution(Vec3(5, 1, 2));
  params.placement.max_tries = 5;
  Scatter3d(params, stage.host).randomize(stage.scene, {}, Rng(1));
  REQUIRE(stage.host.warnings.size() == 2);
  CHECK_THAT(stage.host.warnings[0],
             ContainsSubstring("/Assets/cube_01: no free place in 5 tries"));
  CHECK(stage.place(2) == Vec3(5, 1, 2));
}

TEST_CASE("Patterns that lead nowhere are told in words", "[placement]") {
  Stage stage(1);
  Scatter2d::Params on_nothing;
  on_nothing.surfaces = "/Environment/sofa/**";
  Scatter2d(on_nothing, stage.host).randomize(stage.scene, {}, Rng(1));
  REQUIRE(stage.host.warnings.size() == 1);
  CHECK_THAT(stage.host.warnings[0],
             ContainsSubstring("'/Environment/sofa/**' is visible and faces upwards"));
  CHECK(stage.place(0) == Vec3::Zero());
  Scatter3d::Params in_nothing;
  in_nothing.volumes = "/Marks/*";
  CHECK_THAT(text_of([&] { Scatter3d(in_nothing, stage.host).randomize(stage.scene, {}, Rng(1)); }),
             ContainsSubstring("'/Marks/*' has a mesh"));
}

TEST_CASE("What waits at the origin for another randomizer is in nobody's way", "[placement]") {
  Stage stage(1);
  const NodeId other = stage.scene.create(stage.scene.find("/Assets"), "waits");
  stage.scene.edit(other).mesh = std::make_shared<const Mesh>(make_box(Vec3::Constant(2)));
  stage.scene.edit(other).rigid_body = RigidBody{};
  Scatter3d::Params params;
  params.placement.nodes = "/Assets/cube";
  params.placement.max_tries = 3;
  params.offset = Distribution(Vec3(0, 0, 0.5));
  Scatter3d(params, stage.host).randomize(stage.scene, {}, Rng(1));
  CHECK(stage.host.warnings.empty());
  stage.scene.set_pose(other, Affine(Eigen::Translation3d(0, 0, 1.2)));
  Scatter3d(params, stage.host).randomize(stage.scene, {}, Rng(1));
  CHECK(stage.host.warnings.size() == 1);
}
