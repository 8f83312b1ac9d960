// SPDX-License-Identifier: Apache-2.0
#include "collision_world.h"

#include "support/catch.h"

using namespace diorama;

namespace {

NodeId add_mesh(Scene& scene, const std::string& name, const Mesh& mesh, const Affine& pose) {
  const NodeId node = scene.create(scene.root(), name);
  scene.edit(node).mesh = std::make_shared<const Mesh>(mesh);
  scene.set_pose(node, pose);
  return node;
}

Affine at(double x, double y, double z) { return Affine(Eigen::Translation3d(x, y, z)); }

/// An open cup: a cylinder without its lid, made of the wall and the bottom of a box.
Mesh make_open_box(double size) {
  Mesh mesh = make_box(Vec3::Constant(size));
  std::erase_if(mesh.triangles, [&](const auto& triangle) {
    return std::all_of(triangle.begin(), triangle.end(), [&](std::uint32_t corner) {
      return mesh.positions[corner].z() > 0.49f * float(size);
    });
  });
  return mesh;
}

}  // namespace

TEST_CASE("Boxes meet when their faces cross, and only then", "[placement]") {
  Scene scene;
  const NodeId table = add_mesh(scene, "table", make_box(Vec3(2, 1, 0.5)), at(3, 0, 0.25));
  const NodeId cube = add_mesh(scene, "cube", make_box(Vec3::Constant(0.2)), at(3, 0, 1));
  CollisionWorld world;
  world.add(CollisionBody(scene, table), Vec3::Zero());
  const CollisionBody body(scene, cube);
  CHECK(world.is_free(body, Vec3::Zero()));
  CHECK(world.is_free(body, Vec3(0, 0, -0.399)));
  CHECK_FALSE(world.is_free(body, Vec3(0, 0, -0.401)));
  CHECK(world.is_free(body, Vec3(1.101, 0, -0.8)));
  CHECK_FALSE(world.is_free(body, Vec3(1.099, 0, -0.8)));
  CHECK(world.is_free(body, Vec3(0, -0.601, -0.8)));
}

TEST_CASE("Meshes are met, not their boxes", "[placement]") {
  Scene scene;
  const NodeId ball = add_mesh(scene, "ball", make_sphere(1.0, 96), at(0, 0, 0));
  const NodeId cube = add_mesh(scene, "cube", make_box(Vec3::Constant(0.2)), at(0, 0, 0));
  CollisionWorld world;
  world.add(CollisionBody(scene, ball), Vec3::Zero());
  // At the corner of the ball's box there is room.
  CHECK(world.is_free(CollisionBody(scene, cube), Vec3(0.8, 0.8, 0.8)));
  CHECK_FALSE(world.is_free(CollisionBody(scene, cube), Vec3(0.6, 0.6, 0.6)));
}

TEST_CASE("A closed mesh is solid, an open one can be filled", "[placement]") {
  Scene scene;
  const NodeId crate = add_mesh(scene, "crate", make_box(Vec3::Constant(1)), at(0, 0, 0));
  const NodeId tray = add_mesh(scene, "tray", make_open_box(1), at(5, 0, 0));
  const NodeId apple = add_mesh(scene, "apple", make_sphere(0.1), at(0, 0, 0));
  CollisionWorld world;
  world.add(CollisionBody(scene, crate), Vec3::Zero());
  world.add(CollisionBody(scene, tray), Vec3::Zero());
  const CollisionBody body(scene, apple);
  CHECK_FALSE(world.is_free(body, Vec3::Zero()));
  CHECK(world.is_free(body, Vec3(5, 0, -0.3)));
  // The other way round: what would swallow something small.
  CollisionWorld small;
  small.add(CollisionBody(scene, apple), Vec3::Zero());
  CHECK_FALSE(small.is_free(CollisionBody(scene, crate), Vec3::Zero()));
}

TEST_CASE("Rotation and scale of the node and of those above it count", "[placement]") {
  Scene scene;
  const NodeId group = scene.create(scene.root(), "group");
  Transform pose;
  pose.translation = Vec3(1, 2, 3);
  pose.rotation = Quat(Eigen::AngleAxisd(0.25 * kPi, Vec3::UnitZ()));
  pose.scale = Vec3::Constant(0.5);
  scene.set_pose(group, pose);
  const NodeId bar = scene.create(group, "bar");
  scene.edit(bar).mesh = std::make_shared<const Mesh>(make_box(Vec3(4, 0.2, 0.2)));
  const CollisionBody body(scene, group);
  CHECK(body.bounds_world().size().x() == Approx((2.0 + 0.1) / std::sqrt(2.0)));
  CollisionWorld world;
  world.add(CollisionBody(scene, bar), Vec3::Zero());
  const NodeId probe = add_mesh(scene, "probe", make_box(Vec3::Constant(0.02)), at(0, 0, 0));
  const CollisionBody small(scene, probe);
  // 0.9 m along the bar, and beside it.
  CHECK_FALSE(world.is_free(small, Vec3(1 + 0.636, 2 + 0.636, 3)));
  CHECK(world.is_free(small, Vec3(1 + 0.636, 2 - 0.636, 3)));
}

TEST_CASE("A node without meshes is free everywhere", "[placement]") {
  Scene scene;
  const CollisionBody nothing(scene, scene.create(scene.root(), "empty"));
  CHECK_FALSE(nothing.has_shape());
  CHECK(CollisionWorld().is_free(nothing, Vec3::Zero()));
}
