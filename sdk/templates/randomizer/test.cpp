// SPDX-License-Identifier: @LICENCE@
#include <diorama/randomizer.h>

#include "plugin_under_test.h"

using diorama::Vec3;

namespace {

/// Pose of `name` after a run over a scene with `count` nodes below /Assets.
diorama::Affine randomized(diorama::Randomizer& randomizer, const char* name, int count) {
  diorama::Scene scene;
  const diorama::NodeId assets = scene.create(scene.root(), "Assets");
  for (int i = 0; i < count; ++i) scene.create(assets, "cup");
  const diorama::NodeId node = scene.require(name);
  scene.set_pose(node, diorama::Affine(Eigen::Translation3d(1, 2, 3)));
  diorama::RandomizeContext context;
  context.moment = "environment";
  randomizer.randomize(scene, context, diorama::Rng(5));
  return scene.world_from_node(node);
}

}  // namespace

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  const auto randomizer = plugin.make<diorama::Randomizer>();
  const diorama::Affine pose = randomized(*randomizer, "/Assets/cup", 1);
  check(pose.translation() == Vec3(1, 2, 3), "the place stays");
  check((pose.linear() * Vec3::UnitZ()).isApprox(Vec3::UnitZ()), "the vertical axis stays");
  check(!pose.linear().isApprox(diorama::Mat3::Identity(), 1e-3), "the node turns");
  check(pose.isApprox(randomized(*randomizer, "/Assets/cup", 3)),
        "other nodes do not change the turn");
  check(!pose.isApprox(randomized(*randomizer, "/Assets/cup_01", 3)), "each node turns for itself");
}
