// SPDX-License-Identifier: Apache-2.0
#include <diorama/randomizer.h>

#include <cmath>

#include "plugin_under_test.h"

using diorama::Affine;
using diorama::Vec3;

namespace {

/// Pose of the camera "name" after a shake with this seed; `count` cameras stand in the scene.
Affine shaken(diorama::Randomizer& shake, std::uint64_t seed, const char* name, int count) {
  diorama::Scene scene;
  const diorama::NodeId cameras = scene.create(scene.root(), "Cameras");
  for (int i = 0; i < count; ++i) {
    scene.create(cameras, "cam_" + std::to_string(i));
  }
  diorama::RandomizeContext context;
  context.moment = "floating";
  context.capture = 0;
  shake.randomize(scene, context, diorama::Rng(seed));
  return scene.world_from_node(scene.require(name));
}

double variance(const std::vector<double>& numbers) {
  double sum = 0.0;
  for (const double number : numbers) sum += number * number;
  return sum / double(numbers.size());
}

}  // namespace

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  const auto shake = plugin.make<diorama::Randomizer>();

  std::vector<double> places, pans, rolls;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    const Affine pose = shaken(*shake, seed, "/Cameras/cam_0", 1);
    places.push_back(pose.translation().y());
    const Vec3 ahead = pose.linear() * -Vec3::UnitZ();
    pans.push_back(std::atan2(ahead.x(), -ahead.z()));
    rolls.push_back((pose.linear() * Vec3::UnitX()).y());
  }
  const auto near = [](double found, double wanted) {
    return std::abs(found / wanted - 1.0) < 0.1;
  };
  const double degree = diorama::kPi / 180.0;
  check(near(std::sqrt(variance(places)), 0.005), "it sways by 5 mm");
  check(near(std::sqrt(variance(pans)), degree), "it pans by a degree");
  check(near(std::sqrt(variance(rolls)), 0.3 * degree), "it rolls by a third of that");

  check(shaken(*shake, 3, "/Cameras/cam_1", 2).isApprox(shaken(*shake, 3, "/Cameras/cam_1", 5)),
        "more cameras leave the shake as it was");
  check(!shaken(*shake, 3, "/Cameras/cam_0", 2).isApprox(shaken(*shake, 3, "/Cameras/cam_1", 2)),
        "each camera shakes for itself");

  diorama::Value still = diorama::Value::make_map();
  for (const char* key : {"sway_m", "aim_deg", "roll_deg"})
    still.set(key, diorama::Value::number(0));
  check(shaken(*plugin.make<diorama::Randomizer>(still), 3, "/Cameras/cam_0", 1)
            .isApprox(Affine::Identity()),
        "zeros hold it still");
}
