// SPDX-License-Identifier: Apache-2.0
#include <diorama/scene.h>
#include <cstdio>

int main() {
  diorama::Scene scene;
  const diorama::NodeId cup = scene.create(scene.root(), "cup");
  scene.edit(cup).mesh = std::make_shared<const diorama::Mesh>(diorama::make_cylinder(0.05, 0.1));
  diorama::Transform twice;
  twice.scale = diorama::Vec3(2, 2, 2);
  scene.set_pose(cup, twice);
  std::printf("%s is %.2f m high\n", scene.path(cup).c_str(), scene.world_bounds(cup).size().z());
}
