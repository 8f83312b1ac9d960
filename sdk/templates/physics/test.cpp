// SPDX-License-Identifier: @LICENCE@
#include <diorama/physics_backend.h>

#include "plugin_under_test.h"

namespace {

diorama::NodeId add_ball(diorama::Scene& scene, double z, bool has_gravity) {
  const diorama::NodeId id = scene.create(scene.root(), "ball");
  scene.set_pose(id, diorama::Affine(Eigen::Translation3d(1, 2, z)));
  diorama::Node& node = scene.edit(id);
  node.mesh = std::make_shared<const diorama::Mesh>(diorama::make_sphere(0.5));
  node.rigid_body = diorama::RigidBody{.has_gravity = has_gravity};
  return id;
}

}  // namespace

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  diorama::Value params = diorama::Value::make_map();
  params.set("step_s", diorama::Value::number(0.001));
  const auto physics = plugin.make<diorama::PhysicsBackend>(params);

  diorama::Scene scene;
  const diorama::NodeId falling = add_ball(scene, 10.0, true);
  const diorama::NodeId floating = add_ball(scene, 3.0, false);
  physics->reset(scene);
  physics->advance(scene, 1000);
  const double z = scene.world_from_node(falling).translation().z();
  check(std::abs(z - (10.0 - 0.5 * 9.81)) < 0.01, "after a second it fell by g / 2");
  check(scene.world_from_node(floating).translation().z() == 3.0, "without gravity it stays");

  physics->advance(scene, 5000);
  check(std::abs(scene.world_from_node(falling).translation().z() - 0.5) < 1e-5,
        "it comes to rest on the ground");
  check(physics->report().sleeping_bodies == 1, "and is reported to sleep");
}
