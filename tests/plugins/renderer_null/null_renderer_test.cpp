// SPDX-License-Identifier: Apache-2.0
#include "null_renderer.h"

#include <cmath>

#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

struct World {
  Scene scene;
  NodeId wall;
  NodeId ball;
  NodeId camera;

  /// A wall of 3 x 2 m at distance 4 before the camera and a ball half hiding it; the camera is
  /// turned and shifted.
  World() {
    camera = scene.create(scene.root(), "camera");
    Camera lens;
    lens.width = 80;
    lens.height = 50;
    lens.fx = 60;
    lens.fy = 70;
    lens.cx = 37;
    lens.cy = 28;
    scene.edit(camera).camera = lens;
    Transform pose;
    pose.translation = Vec3(1, 2, 3);
    pose.rotation = look_rotation(Vec3(0.4, -0.8, -0.3));
    scene.set_pose(camera, pose);
    wall = add("wall", make_plane(3, 2), Vec3(0.1, -0.2, -4));
    ball = add("ball", make_sphere(0.5, 96), Vec3(0.6, 0.3, -2.5));
  }
  NodeId add(const char* name, Mesh mesh, const Vec3& in_camera) {
    const NodeId node = scene.create(scene.root(), name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(std::move(mesh));
    scene.set_pose(node, Affine(scene.world_from_node(camera) * Eigen::Translation3d(in_camera)));
    return node;
  }
};

NameSet geometry() {
  return {std::string(kLeafId.name), std::string(kDistanceToImagePlane.name),
          std::string(kDistanceToCamera.name), std::string(kNormals.name), std::string(kUv.name)};
}

}  // namespace

TEST_CASE("a wall covers the pixels into which its corners project", "[null]") {
  World world;
  world.scene.edit(world.ball).is_visible = false;
  test::RenderHost host(2);
  NullRenderer renderer({}, host);
  renderer.prepare(world.scene);
  const Frame frame = renderer.render({world.camera, geometry(), 1});
  const Vec2 low = *project(frame.camera, Vec3(0.1 - 1.5, -0.2 + 1.0, -4));
  const Vec2 high = *project(frame.camera, Vec3(0.1 + 1.5, -0.2 - 1.0, -4));
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 80; ++x) {
      const Vec2 p(x + 0.5, y + 0.5);
      const bool is_inside = (p.array() > low.array()).all() && (p.array() < high.array()).all();
      CAPTURE(x, y);
      CHECK(frame.get(kLeafId).at(x, y) == (is_inside ? world.wall.index : 0));
      if (!is_inside) continue;
      CHECK(frame.get(kDistanceToImagePlane).at(x, y) == Approx(4.0).margin(1e-5));
      const double slant = 1.0 / -ray_direction(frame.camera, p)->z();
      CHECK(frame.get(kDistanceToCamera).at(x, y) == Approx(4.0 * slant).margin(1e-5));
      const Vec2 share = (p - low).cwiseQuotient(high - low);
      CHECK(frame.get(kUv).at(x, y).x() == Approx(share.x()).margin(1e-4));
      CHECK(frame.get(kUv).at(x, y).y() == Approx(1.0 - share.y()).margin(1e-4));
    }
  }
}

TEST_CASE("the nearer surface hides the farther, and cover() ignores that", "[null]") {
  World world;
  test::RenderHost host(2);
  NullRenderer renderer({}, host);
  renderer.prepare(world.scene);
  const Frame frame = renderer.render({world.camera, geometry(), 1});
  const std::vector<LabelledInstance> instances{{world.wall, {world.wall}},
                                                {world.ball, {world.ball}}};
  const auto masks = renderer.cover(world.camera, instances);
  int both = 0;
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 80; ++x) {
      const bool has_ball = masks[1].covers(x, y);
      const bool has_wall = masks[0].covers(x, y);
      both += has_ball && has_wall;
      const std::uint32_t expected = has_ball ? world.ball.index : has_wall ? world.wall.index : 0;
      CHECK(frame.get(kLeafId).at(x, y) == expected);
    }
  }
  CHECK(both > 100);
  CHECK(frame.leaf_paths.at(world.ball.index) == "/ball");
}

TEST_CASE("colours are flat, never black where something is, and repeatable", "[null]") {
  World world;
  const NameSet channels{std::string(kColor.name), std::string(kLeafId.name)};
  test::RenderHost host(1);
  NullRenderer renderer({}, host);
  renderer.prepare(world.scene);
  const Frame a = renderer.render({world.camera, channels, 1});
  test::RenderHost many(7);
  NullRenderer other({}, many);
  other.prepare(world.scene);
  const Frame b = other.render({world.camera, channels, 1});
  CHECK(a.get(kColor) == b.get(kColor));
  for (std::size_t i = 0; i < a.get(kColor).pixels().size(); ++i) {
    const Rgba8& p = a.get(kColor).pixels()[i];
    CHECK((p[0] + p[1] + p[2] > 0) == (a.get(kLeafId).pixels()[i] != 0));
  }
}

}  // namespace diorama
