// SPDX-License-Identifier: @LICENCE@
#include <diorama/loader.h>

#include "plugin_under_test.h"

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  diorama::Value params = diorama::Value::make_map();
  params.set("height_m", diorama::Value::number(2.0));
  const auto loader = plugin.make<diorama::Loader>(params);
  check(loader->assets() == std::vector<std::string>{"@NAME@:4"}, "a job's entry names a shelf");

  diorama::Scene scene;
  const diorama::NodeId root = scene.create(scene.root(), "shelf");
  loader->load("@NAME@:3", scene, root);
  const diorama::Aabb bounds = scene.world_bounds(root);
  check(bounds.size().isApprox(diorama::Vec3(0.8, 0.3, 2.0), 1e-5), "it has the size asked for");
  check(std::abs(bounds.min.z()) < 1e-5, "it stands on the ground");
  check(scene.match("/shelf/board*").size() == 3, "it has three boards");
  check(diorama::labelled_instances(scene).size() == 1, "it is one labelled thing");

  std::string message;
  try {
    loader->load("@NAME@:many", scene, root);
  } catch (const diorama::Error& error) {
    message = error.what();
  }
  check(message == "@NAME@:many: expected a number of boards in [2, 50]", "nonsense is refused");
}
