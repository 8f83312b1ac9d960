// SPDX-License-Identifier: Apache-2.0
#include "framework/inspect/scene_report.h"

#include <memory>

#include "diorama/scene.h"
#include "support/catch.h"

using namespace diorama;

namespace {

/// Two boxes that share a mesh, one moved and hidden; a textured material; a lamp.
Scene make_scene() {
  Scene scene;
  const NodeId group = scene.create(scene.root(), "room");
  auto mesh = std::make_shared<Mesh>(make_box({1, 2, 3}));
  auto texture = std::make_shared<Texture>();
  texture->name = "wood.png";
  texture->width = 4;
  texture->height = 2;
  texture->channels = 3;
  texture->bytes.resize(24);
  auto material = std::make_shared<Material>();
  material->name = "wood";
  material->base_color_texture.texture = texture;
  material->roughness_texture.texture = texture;

  const NodeId first = scene.create(group, "box");
  scene.edit(first).mesh = mesh;
  scene.edit(first).materials = {material};
  const NodeId second = scene.create(group, "box");
  scene.edit(second).mesh = mesh;
  scene.edit(second).materials = {material};
  scene.edit(second).is_visible = false;
  scene.edit(second).labels["class"] = "crate";
  scene.set_pose(second, Transform{Vec3(10, 0, 0), Quat::Identity(), Vec3::Ones()});
  const NodeId lamp = scene.create(group, "lamp");
  Light light;
  light.color = Vec3f(3, 2, 1);
  scene.edit(lamp).light = light;
  return scene;
}

}  // namespace

TEST_CASE("a scene report counts shared things once, and measures what can be seen", "[inspect]") {
  const Scene scene = make_scene();
  const SceneReport report = report_scene(scene, scene.find("/room"), "room.usd");
  CHECK(report.nodes == 4);
  CHECK(report.meshes == 2);
  CHECK(report.unique_meshes == 1);
  CHECK(report.triangles == 2 * report.unique_triangles);
  CHECK(report.textures == 1);
  CHECK(report.texture_bytes == 24);
  CHECK(report.labelled == 1);
  REQUIRE(report.materials.size() == 1);
  CHECK(report.materials[0].users == 2);
  CHECK(report.materials[0].textures == std::vector<std::string>{"wood.png"});
  CHECK(report.bounds.min.isApprox(Vec3(-0.5, -1, -1.5)));
  CHECK(report.bounds.max.isApprox(Vec3(0.5, 1, 1.5)));
}

TEST_CASE("a scene report prints tree, lights and warnings", "[inspect]") {
  const Scene scene = make_scene();
  SceneReport report = report_scene(scene, scene.find("/room"), "room.usd");
  report.warnings.push_back("room.usd: texture 'x.png' is missing");
  const std::string text = report_text(report, -1);
  CHECK(text.find("(hidden)") != std::string::npos);
  CHECK(text.find("class=crate") != std::string::npos);
  CHECK(text.find("/room/lamp  sphere  (3, 2, 1)") != std::string::npos);
  CHECK(text.find("warnings (1)\n  room.usd: texture 'x.png' is missing") != std::string::npos);
  CHECK(report_text(report, 0).find("... 3 deeper nodes") != std::string::npos);
}

TEST_CASE("a scene report says which lamps no sky is seen beside", "[inspect]") {
  Scene scene = make_scene();
  CHECK(report_scene(scene, scene.find("/room"), "room.usd").warnings.empty());
  for (const char* name : {"bulb", "spot"}) {
    const NodeId lamp = scene.create(scene.find("/room"), name);
    Light light;
    light.radius_m = 0.05;
    light.color = Vec3f::Constant(name[0] == 'b' ? 3e8f : 2e8f);
    scene.edit(lamp).light = light;
  }
  const SceneReport report = report_scene(scene, scene.find("/room"), "room.usd");
  REQUIRE(report.warnings.size() == 1);
  // 3e8 nits x pi 0.05^2 m^2 / (2 m)^2.
  CHECK(
      report.warnings[0] ==
      "/room/bulb (the brightest of 2 such lamps) lights a surface 2 m away with 5.89e+05 lux, 188 "
      "times as much as an open sky of 1000 nits: no sky will be seen beside it; "
      "environment.max_lamp_lux dims such lamps in a job");
  CHECK(report_text(report, -1).find("5.89e+05 lux at 2 m") != std::string::npos);
}

TEST_CASE("a material stands with the warnings that name it", "[inspect]") {
  const Scene scene = make_scene();
  SceneReport report = report_scene(scene, scene.find("/room"), "room.usd");
  const std::string missing = "room.usd: texture @x.png@ could not be found (material 'wood')";
  report.warnings = {"room.usd: 'woodwork' is something else", missing};
  CHECK(warnings_about(report, "wood") == std::vector<std::string>{missing});
  CHECK(warnings_about(report, "").empty());
  CHECK(report_text(report, -1).find("  wood  used 2x  [wood.png]\n    ! " + missing + "\n") !=
        std::string::npos);
  CHECK(report_json(report).find("\"warnings\": [\n        \"room.usd: texture") !=
        std::string::npos);
}

TEST_CASE("a report of nothing says that there are no bounds", "[inspect]") {
  Scene scene;
  const NodeId empty = scene.create(scene.root(), "empty");
  const SceneReport report = report_scene(scene, empty, "empty.usd");
  CHECK(report_text(report, -1).find("bounds: none") != std::string::npos);
  CHECK(report_json(report).find("\"bounds_m\": null") != std::string::npos);
}
