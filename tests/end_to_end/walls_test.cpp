// SPDX-License-Identifier: Apache-2.0
// Objects within walls, thrown up by a floor that is none: what object-based jobs consist of.
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

constexpr const char* kWallJob = R"(
seed: 3
total_captures: 20
environments: [{type: empty}]
environment: {colliders: none, walls: [2, 3, 1]}
objects:
  - {type: shapes, name: falling, count: 12, label: shape}
  - {type: shapes, name: floating, count: 6, label: shape, gravity_disabled_chance: 1}
lights: [{type: dome, name: sky}]
cameras: [{type: pinhole, name: cam, width: 64, height: 48, near_m: 0.01}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*", offset: [[-1, 1], [-1.5, 1.5], [-0.5, 0.5]], scale: [0.05, 0.1]}
  - {type: random_velocities, name: drift, on: [frame], every: 7, nodes: "/Assets/floating_*", velocity: [[-2.5, 2.5], [-2.5, 2.5], [-2.5, 2.5]]}
  - {type: random_velocities, name: bounce, on: [bounce], nodes: "/**", velocity: [[-2, 2], [-2, 2], [4, 8]], box_min: [-1, -1.5, -0.5], box_max: [1, 1.5, -0.4]}
  - {type: orbit_cameras, name: orbit, on: [cameras], distance: [0.25, 0.75]}
physics: {type: bullet, floating_damping: 0}
renderer: {type: "null"}
timeline:
  - repeat: 20
    steps:
      - {event: cameras, every: 3}
      - {simulate: 4, camera_radius_m: 0.5, each_step: bounce, every: 3}
      - {simulate: 9, each_step: bounce}
      - {capture: frame}
settle: {policy: keep}
writers: [{type: BasicWriter, name: basic, rgb: true}]
output: {folder: out}
)";

}  // namespace

TEST_CASE("What is thrown about within walls stays there and comes up again", "[run][walls]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", kWallJob);
  const auto files_of = [&](const std::string& output, std::vector<std::string> more) {
    std::vector<std::string> arguments{"run", "job.yaml", "--output", output};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments, folder.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
    return tree(folder / output);
  };
  const auto files = files_of("out", {});

  std::map<std::string, std::vector<std::array<double, 3>>> ways;
  for (const auto& [name, text] : files) {
    if (!name.starts_with("settle/")) continue;
    const auto report = nlohmann::json::parse(text);
    for (const auto& node : report["placed"]) {
      const auto& rows = node["parent_from_node"];
      const std::string path = node["node"];
      if (path.starts_with("/Assets/")) {
        ways[path].push_back(
            {rows[3].get<double>(), rows[7].get<double>(), rows[11].get<double>()});
      }
    }
  }
  CHECK(ways.size() == 18);
  for (const auto& [path, places] : ways) {
    INFO(path);
    for (const auto& [x, y, z] : places) {
      CHECK(std::abs(x) < 1.0);
      CHECK(std::abs(y) < 1.5);
      CHECK(std::abs(z) < 0.5);
    }
  }
  // Three seconds are enough to fall down several times: without the bounce all would lie there.
  const auto mean_height = [&](const std::string& output) {
    double sum = 0.0;
    int count = 0;
    for (const auto& [name, text] : tree(folder / output)) {
      if (!name.starts_with("settle/")) continue;
      const auto report = nlohmann::json::parse(text);
      for (const auto& node : report["placed"]) {
        if (!node["node"].get<std::string>().starts_with("/Assets/falling_")) continue;
        sum += node["parent_from_node"][11].get<double>();
        ++count;
      }
    }
    REQUIRE(count == 12);
    return sum / count;
  };
  const double bouncing = mean_height("out");
  files_of("still", {"--set", "randomizers[2].velocity=[0, 0, 0]"});
  CHECK(mean_height("still") < -0.2);
  CHECK(bouncing > mean_height("still") + 0.1);
}

TEST_CASE("Spheres round cameras push away what is near, and are gone afterwards", "[run][walls]") {
  // A small ball 0.2 m in front of the camera, and one out of its reach.
  constexpr const char* kPush = R"(
total_captures: 1
environments: [{type: empty}]
objects:
  - {type: shapes, name: near, under: /Near, count: 1, shapes: [sphere], gravity_disabled_chance: 1}
  - {type: shapes, name: far, under: /Far, count: 1, shapes: [sphere], gravity_disabled_chance: 1}
cameras: [{type: pinhole, name: cam, width: 64, height: 48, near_m: 0.01, position: [1, 2, 3], look_at: [1, 3, 3]}]
randomizers:
  - {type: scatter_poses, name: near, on: [environment], nodes: "/Near/*", offset: [1, 2.2, 3], scale: 0.05}
  - {type: scatter_poses, name: far, on: [environment], nodes: "/Far/*", offset: [1, 4, 3], scale: 0.05}
renderer: {type: "null"}
timeline: [{simulate: 60, camera_radius_m: 0.5}, {capture: frame}]
settle: {policy: keep}
writers: [{type: BasicWriter, name: basic, rgb: true}]
output: {folder: out}
)";
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", kPush);
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  std::map<std::string, double> distance;
  for (const auto& [name, text] : tree(folder / "out")) {
    if (!name.starts_with("settle/")) continue;
    const auto report = nlohmann::json::parse(text);
    for (const auto& node : report["placed"]) {
      const auto& rows = node["parent_from_node"];
      const double x = rows[3].get<double>() - 1.0, y = rows[7].get<double>() - 2.0;
      const double z = rows[11].get<double>() - 3.0;
      distance[node["node"].get<std::string>().substr(0, 5)] = std::sqrt(x * x + y * y + z * z);
    }
  }
  REQUIRE(distance.size() == 2);
  CHECK(distance["/Near"] > 0.54);
  CHECK(distance["/Near"] < 0.7);
  CHECK(distance["/Far/"] == Approx(2.0).margin(1e-6));
}
