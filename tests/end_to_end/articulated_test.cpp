// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "diorama/reader.h"
#include "framework/pipeline/fake_host.h"
#include "program.h"
#include "support/catch.h"
#include "support/shared_data.h"
#include "writer_basic/basic_reader.h"

using namespace diorama::test;
using Json = nlohmann::json;

namespace {

/// The example's job without light, with several captures of each visit.
std::string example_job(const TemporaryFolder& folder, const std::string& joints) {
  const fs::path example = fs::path(DIORAMA_SOURCE_DIR) / "examples/articulated";
  for (const char* name : {"cabinet.usda", "cabinet.urdf", "room.usda", "figure.usda"}) {
    fs::copy_file(example / name, folder / name);
  }
  std::string job = read_file(example / "job.yaml");
  const auto replace = [&](const std::string& from, const std::string& to) {
    const std::size_t at = job.find(from);
    REQUIRE(at != std::string::npos);
    job.replace(at, from.size(), to);
  };
  replace("renderer: {samples: 32}", "renderer: {type: \"null\"}");
  replace("width: 480, height: 320", "width: 96, height: 64");
  replace("joints: held", "joints: " + joints);
  return job;
}

}  // namespace

TEST_CASE("Drawers are open at random, labelled by part, and told in the labels", "[run]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", example_job(folder, "held"));
  const Outcome outcome = run({"run", "job.yaml", "--output", "out"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  CHECK(outcome.errors.find("warning") == std::string::npos);

  std::set<double> drawers;
  std::set<std::string> paths;
  for (int capture = 0; capture < 3; ++capture) {
    const std::string number = "_000" + std::to_string(capture);
    const Json states =
        Json::parse(read_file(folder / ("out/basic/joint_states" + number + ".json")));
    REQUIRE(states["joints"].size() == 8);
    for (const Json& joint : states["joints"]) {
      const double position = joint["position"];
      CHECK(position >= joint["lower_limit"].get<double>() - 1e-9);
      CHECK(position <= joint["upper_limit"].get<double>() + 1e-9);
      if (joint["name"] == "drawer_low_slide") {
        CHECK(joint["kind"] == "prismatic");
        drawers.insert(position);
      }
    }
    const Json rows = Json::parse(
        read_file(folder / ("out/basic/bounding_box_2d_tight_prim_paths" + number + ".json")));
    for (const Json& path : rows) paths.insert(path.get<std::string>());
  }
  CHECK(drawers.size() >= 4);
  const auto has = [&](const std::string& part) {
    return std::any_of(paths.begin(), paths.end(),
                       [&](const std::string& path) { return path.ends_with(part); });
  };
  // Of the room's cabinet by the file's labels, of the object by the job's.
  for (const char* part : {"/cabinet/drawer_low", "/cabinet/drawer_high", "/cabinet/body"}) {
    CHECK(has(part));
  }
  CHECK(has("/cabinet/drawer_mid"));
  CHECK(std::any_of(paths.begin(), paths.end(), [](const std::string& path) {
    return path.starts_with("/Assets/floating_cabinet") && path.ends_with("drawer_mid");
  }));
  CHECK(std::any_of(paths.begin(), paths.end(), [](const std::string& path) {
    return path.find("_person") != std::string::npos;
  }));
  const std::string info = read_file(folder / "out/dataset.json");
  CHECK(info.find("\"drawer\"") != std::string::npos);
  CHECK(info.find("\"door\"") != std::string::npos);

  const Outcome lint = run({"lint", "out"}, folder.path());
  INFO(lint.output);
  CHECK(lint.exit_code == 0);

  // Read back.
  diorama::test::FakeHost host;
  const diorama::BasicReader reader({}, host);
  const auto dataset = reader.open(folder / "out/basic");
  CHECK(dataset->info().holds.contains(diorama::kHoldsJoints));
  const auto stored = dataset->read(1, dataset->info().holds);
  REQUIRE(stored.capture.frames.size() == 1);
  REQUIRE(stored.capture.frames[0].joints.size() == 8);
  const Json first = Json::parse(read_file(folder / "out/basic/joint_states_0001.json"));
  for (std::size_t i = 0; i < 8; ++i) {
    const diorama::JointState& state = stored.capture.frames[0].joints[i];
    CHECK(state.path == first["joints"][i]["prim_path"].get<std::string>());
    CHECK(state.position == first["joints"][i]["position"]);
    CHECK(state.upper == first["joints"][i]["upper_limit"]);
  }
}

TEST_CASE("A foreign articulation is posed, labelled by part and falls in one piece",
          "[run][shared]") {
  const auto shared = diorama::test::shared_folder();
  if (!shared) {
    WARN("the shared files are not there");
    return;
  }
  const std::string figure =
      (*shared / "data/usd/newton/newton/examples/assets/humanoid.usda").string();
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", R"(
seed: 4
total_captures: 2
environments: [{type: shapes, shapes: [cube]}]
environment: {colliders: triangle_mesh}
objects:
  - {type: files, name: figure, files: [")" +
                                      figure + R"("], under: /Assets, label: figure, joints: free,
     parts: {"*shin*": shin, "*foot*": foot}}
lights: [{type: dome, name: sky}]
cameras: [{type: pinhole, name: cam, width: 160, height: 120, position: [0, -5, 2.5], look_at: [0, 0, 1.5]}]
randomizers:
  - {type: joint_states, name: openings, on: [environment], joints: ["/Assets/**"]}
  - {type: scatter_poses, name: place, on: [environment], nodes: "/Assets/*", offset: [0, 0, 2.2], rotation: none,
     avoid_overlap: false}
settle: {policy: keep}
timeline: [{capture: posed}, {simulate: 60}, {capture: fallen}]
renderer: {type: "null"}
writers:
  - {type: BasicWriter, name: basic, semantic_segmentation: true, bounding_box_3d: true, joint_states: true}
output: {folder: out}
)");
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  std::set<double> knees;
  for (const char* number : {"_0000", "_0001"}) {
    const Json states =
        Json::parse(read_file(folder / ("out/basic/joint_states" + std::string(number) + ".json")));
    REQUIRE(states["joints"].size() == 24);  // 21 axes and 3 that are fixed
    for (const Json& joint : states["joints"]) {
      const double position = joint["position"];
      // The engine holds limits to some hundredths of a radian.
      if (joint["kind"] == "fixed") continue;
      CHECK(position >= joint["lower_limit"].get<double>() - 0.1);
      CHECK(position <= joint["upper_limit"].get<double>() + 0.1);
      if (joint["name"] == "left_knee") knees.insert(position);
    }
    const std::string labels =
        read_file(folder / ("out/basic/bounding_box_3d_labels" + std::string(number) + ".json"));
    for (const char* part : {"\"figure\"", "\"shin\"", "\"foot\""}) {
      CHECK(labels.find(part) != std::string::npos);
    }
  }
  CHECK(knees.size() == 2);
  const Outcome lint = run({"lint", "out"}, folder.path());
  INFO(lint.output);
  CHECK(lint.exit_code == 0);
}

TEST_CASE("Joint states that cannot be are found", "[run]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", example_job(folder, "held"));
  REQUIRE(run({"run", "job.yaml", "--output", "out"}, folder.path()).exit_code == 0);
  Json states = Json::parse(read_file(folder / "out/basic/joint_states_0001.json"));
  states["joints"][2]["kind"] = "elastic";
  write_file(folder / "out/basic/joint_states_0001.json", states.dump());
  const Outcome lint = run({"lint", "out/basic"}, folder.path());
  CHECK(lint.exit_code != 0);
  CHECK(lint.output.find("a joint is of no known kind") != std::string::npos);
}
