// SPDX-License-Identifier: Apache-2.0
#include "framework/bench/scene_rig.h"

#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "support/temporary_folder.h"

using namespace diorama;
using namespace diorama::test;

namespace {

constexpr const char* kRig = R"({
  "camera": {"width": 64, "height": 48, "fx": 50, "fy": 51, "cx": 30, "cy": 20,
             "cam2world_blender": [[0, 0, 1, 2], [1, 0, 0, 3], [0, 1, 0, 4]]},
  "lights": [{"position_blender": [1, 2, 3], "radius": 0.5, "power_watt": 100,
              "color": [1, 0.5, 0.25]}]})";

}  // namespace

TEST_CASE("a rig gives lamps and a camera", "[bench]") {
  const TemporaryFolder folder;
  const std::string rig = folder.write("rig.json", kRig);
  RenderHost host(1);
  Scene scene;
  bench::add_rig_lights(rig, scene, host);
  const NodeId lamp = scene.require("/lamp");
  CHECK(scene.world_from_node(lamp).translation() == Vec3(1, 2, 3));
  const Light& light = *scene[lamp].light;
  // A sphere of this radiance gives off color * power / (4 pi) per direction, times pi for watts.
  CHECK(double(light.color.x()) == Approx(100.0 / (4.0 * kPi * kPi * 0.25)));
  CHECK(light.color.z() == Approx(light.color.x() * 0.25f));
  CHECK_FALSE(light.is_visible_to_camera);

  const NodeId camera = bench::add_rig_camera(rig, scene);
  CHECK(scene[camera].camera->fy == 51.0);
  CHECK(scene[camera].camera->cx == 30.0);
  CHECK(scene.world_from_node(camera) * Vec3(0, 0, -1) == Vec3(1, 3, 4));
}

TEST_CASE("a faulty rig is named", "[bench]") {
  const TemporaryFolder folder;
  RenderHost host(1);
  Scene scene;
  CHECK_THROWS_WITH(bench::add_rig_camera(folder.path("no.json"), scene),
                    ContainsSubstring("no.json: cannot be read"));
  CHECK_THROWS_WITH(bench::add_rig_camera(folder.write("rig.json", "{}"), scene),
                    ContainsSubstring("rig.json: ") && ContainsSubstring("camera"));
  CHECK_THROWS_WITH(
      bench::add_rig_lights(folder.write("rig.json", "{\"lights\": [1]}"), scene, host),
      ContainsSubstring("rig.json: "));
}
