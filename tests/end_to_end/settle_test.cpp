// SPDX-License-Identifier: Apache-2.0
// In the smoke job objects fall beside the room, a cube or a sphere, and go on falling.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "numpy_files.h"
#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

struct Run {
  std::map<std::string, std::string> files;
  std::vector<nlohmann::json> reports;  ///< One per visit.
  std::string log;
};

/// A cube as the room; some objects roll over its edge.
std::vector<std::string> job_with_policy(const std::string& policy) {
  return {"run",      config_file("smoke.yaml"),
          "--output", "out",
          "--set",    "environments=[{type: shapes, shapes: [cube]}]",
          "--set",    "objects.targets.count=12",
          "--set",    "settle.policy=" + policy};
}

Run run_with_policy(const std::string& policy, const std::vector<std::string>& more = {}) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments = job_with_policy(policy);
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  Run result{tree(folder / "out"), {}, outcome.errors};
  for (const auto& [name, text] : result.files) {
    if (name.starts_with("settle/")) result.reports.push_back(nlohmann::json::parse(text));
  }
  REQUIRE(result.reports.size() == 2);
  return result;
}

/// A room with one thing of two metres in it.
void write_room(const fs::path& file, const std::string& thing) {
  write_file(file, R"(#usda 1.0
(
    defaultPrim = "Room"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Room"
{
    def Cube ")" + thing +
                       R"("
    {
        double size = 2
    }
}
)");
}

std::size_t sum(const Run& run, const char* key) {
  std::size_t count = 0;
  for (const auto& report : run.reports) count += report[key].size();
  return count;
}

}  // namespace

TEST_CASE("Kept objects stay outside the room and are reported", "[run][settle]") {
  const Run kept = run_with_policy("keep");
  CHECK(sum(kept, "left_room") > 0);
  CHECK(sum(kept, "respawned") == 0);
  CHECK(sum(kept, "dropped") == 0);
  CHECK_THAT(kept.log, ContainsSubstring("left the room"));
  CHECK(kept.reports[0]["simulated_s"] == Approx(64.0 / 60.0));
}

TEST_CASE("Dropped objects are gone from the visit and its labels", "[run][settle]") {
  const Run kept = run_with_policy("keep");
  const Run dropped = run_with_policy("drop");
  CHECK(sum(dropped, "dropped") == sum(kept, "left_room"));
  CHECK(sum(dropped, "left_room") == 0);
  CHECK_THAT(dropped.log, ContainsSubstring("left the room, so it was taken out"));
}

TEST_CASE("Objects that stay keep their motion when others are dropped", "[run][settle]") {
  const Run run = run_with_policy(
      "drop", {"--set", "total_captures=2", "--set",
               "timeline=[{simulate: 70}, {capture: dropped, count: 1}]", "--set",
               "randomizers.cameras.on=[dropped]", "--set", "writers.basic.motion_vectors=true"});
  REQUIRE(run.reports[1]["dropped"].size() > 0);
  const NpyArray motion =
      parse_npy(run.files.at("basic/rp_cam_0/motion_vectors/motion_vectors_0001.npy"));
  CHECK(std::any_of(motion.data.begin(), motion.data.end(),
                    [](std::byte byte) { return byte != std::byte{0}; }));
}

TEST_CASE("Respawned objects are placed again within their range until they stay",
          "[run][settle]") {
  const Run kept = run_with_policy("keep");
  const Run respawned = run_with_policy("respawn", {"--set", "settle.max_respawns=40"});
  CHECK(sum(respawned, "respawned") >= sum(kept, "left_room"));
  CHECK(sum(respawned, "left_room") == 0);
  // Every retry takes the steps of the simulation once more.
  CHECK(respawned.reports[0]["simulated_s"].get<double>() +
            respawned.reports[1]["simulated_s"].get<double>() >
        2.0 * 64.0 / 60.0 + 0.9);
  // The captures before the fall are those of every policy.
  CHECK(respawned.files.at("basic/rp_cam_0/rgb/rgb_0000.png") ==
        kept.files.at("basic/rp_cam_0/rgb/rgb_0000.png"));
}

TEST_CASE("Retries are the same for any number of threads and split into shards", "[run][settle]") {
  const Run one = run_with_policy("respawn", {"--threads", "1"});
  CHECK(difference(one.files, run_with_policy("respawn", {"--threads", "7"}).files) == "");
  const TemporaryFolder folder;
  for (const char* shard : {"2/2", "1/2"}) {
    std::vector<std::string> arguments = job_with_policy("respawn");
    arguments.insert(arguments.end(), {"--shard", shard});
    const Outcome outcome = run(arguments, folder.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
  }
  CHECK(difference(one.files, tree(folder / "out")) == "");
}

/// Of a job, up to its randomizers: a small ball above the middle.
const std::string kBallAbove =
    R"(objects: [{type: shapes, name: ball, shapes: [sphere], under: /Assets, label: ball}]
cameras: [{type: pinhole, name: cam, width: 64, height: 48}]
lights: [{type: dome, name: sky}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*", offset: [0, 0, 1.3],
     scale: 0.1}
)";

TEST_CASE("What rests on a thing that an event takes away falls", "[run][settle]") {
  const TemporaryFolder folder;
  const auto moved = [&](const std::string& name, const std::string& event) {
    write_file(folder / (name + ".yaml"), R"(
total_captures: 1
environments: [{type: shapes, shapes: [cube]}]
)" + kBallAbove + event + R"(
  - {type: orbit_cameras, name: view, on: [after], nodes: "/Cameras/*", targets: "/Assets/*",
     distance: 2, polar_angle_deg: 80}
settle: {policy: keep}
renderer: {type: "null"}
timeline: [{simulate: 400}, {event: pull}, {simulate: 20}, {capture: after}]
writers: [{type: BasicWriter, name: basic, motion_vectors: true}]
)");
    const Outcome outcome = run({"run", name + ".yaml", "--output", name}, folder.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
    const NpyArray motion = parse_npy(read_file(folder / name / "basic/motion_vectors_0000.npy"));
    return std::any_of(motion.data.begin(), motion.data.end(),
                       [](std::byte byte) { return byte != std::byte{0}; });
  };
  CHECK_FALSE(moved("left_alone", "  - {type: random_colors, on: [pull], nodes: \"/Assets/**\"}"));
  CHECK(moved("pulled_away",
              "  - {type: scatter_poses, on: [pull], nodes: \"/Environment\", "
              "offset: [30, 0, 0], rotation: none, avoid_overlap: false}"));
  CHECK(moved("hidden",
              "  - {type: random_visibility, on: [pull], nodes: \"/Environment/*\", "
              "visible_chance: 0}"));
}

TEST_CASE("Nothing lies on what the job hides, and debug mode changes no scene", "[run][settle]") {
  const TemporaryFolder folder;
  write_room(folder / "room.usda", "Slab");
  const auto falls = [&](const std::string& name, const std::string& more) {
    write_file(folder / (name + ".yaml"), R"(
total_captures: 1
environments: [{type: files, files: [room.usda]}]
)" + kBallAbove + R"(settle: {policy: keep}
renderer: {type: "null"}
timeline: [{simulate: 120}, {capture: after}]
writers: [{type: BasicWriter, name: basic, rgb: true}]
)" + more);
    const Outcome outcome = run({"run", name + ".yaml", "--output", name}, folder.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
    const auto report =
        nlohmann::json::parse(read_file(fs::directory_iterator(folder / name / "settle")->path()));
    return report["max_speed_m_per_s"].get<double>() > 1.0;
  };
  CHECK_FALSE(falls("seen", ""));
  CHECK(falls("hidden", "environment: {hide: [Slab]}\n"));
  CHECK_FALSE(falls("debug", "debug: true\nenvironment: {hide_in_debug: [Slab]}\n"));
}

TEST_CASE("A simulation until rest ends early, and what never rests is placed anew or taken out",
          "[run][settle]") {
  const std::vector<std::string> until_rest{
      "--set", "timeline=[{simulate: {until: rest, at_most: 300}}, {capture: dropped, count: 2}]",
      "--set", "randomizers.cameras.on=[dropped]"};
  const Run kept = run_with_policy("keep", until_rest);
  CHECK(sum(kept, "unsettled") > 0);
  // Objects beside the cube fall for ever; the others lie on it.
  const Run respawned = run_with_policy("respawn", until_rest);
  CHECK(sum(respawned, "unsettled") == 0);
  CHECK(sum(respawned, "respawned") >= sum(kept, "unsettled"));
  for (const auto& report : respawned.reports) {
    CHECK(report["max_speed_m_per_s"].get<double>() < 0.05);
    CHECK(report["simulated_s"].get<double>() > 0.5);
  }
  const Run dropped = run_with_policy("drop", until_rest);
  CHECK(sum(dropped, "unsettled") == 0);
  CHECK(sum(dropped, "dropped") >= sum(kept, "unsettled"));
}

TEST_CASE("A misspelt pattern ends a run and a dry run with the nearest path", "[run]") {
  const TemporaryFolder folder;
  for (const char* key : {"randomizers.poses.nodes", "randomizers.cameras.targets"}) {
    for (const bool is_dry : {false, true}) {
      std::vector<std::string> arguments{"run",   config_file("smoke.yaml"),     "--output", "out",
                                         "--set", std::string(key) + "=/Asset/*"};
      if (is_dry) arguments.push_back("--dry-run");
      const Outcome outcome = run(arguments, folder.path());
      CHECK(outcome.exit_code == 3);
      CHECK_THAT(outcome.errors, ContainsSubstring("did you mean '/Assets/*'?"));
    }
  }
  CHECK_FALSE(fs::exists(folder / "out"));
}

TEST_CASE("What fits in none of the job's environments ends a run and a dry run", "[run]") {
  const TemporaryFolder folder;
  write_room(folder / "room.usda", "Slab");
  write_room(folder / "kitchen.usda", "Stove");
  const auto start = [&](const std::string& set, bool is_dry) {
    std::vector<std::string> arguments{
        "run",      config_file("smoke.yaml"),
        "--output", "out",
        "--set",    "environments=[{type: files, files: [room.usda, kitchen.usda]}]",
        "--set",    set};
    if (is_dry) arguments.push_back("--dry-run");
    return run(arguments, folder.path());
  };
  for (const bool is_dry : {true, false}) {
    CAPTURE(is_dry);
    for (const char* set :
         {"environment.hide=[Slb]", "environment.working_area=Stve",
          "environment.box_colliders=[Slb]", "randomizers.cameras.targets=/Environment/**/Stve*"}) {
      const Outcome outcome = start(set, is_dry);
      INFO(outcome.errors);
      CHECK(outcome.exit_code == 3);
      CHECK_THAT(outcome.errors,
                 ContainsSubstring("in any environment of the job; did you mean '/Environment/"));
    }
  }
  // The second environment has it.
  CHECK(start("environment.hide=[Stove]", true).exit_code == 0);
}

TEST_CASE("Objects picked per visit are the same in every shard, and left out ones are named",
          "[run]") {
  const TemporaryFolder folder;
  const auto start = [&](const std::string& output, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"run",      config_file("smoke.yaml"),
                                       "--output", output,
                                       "--set",    "objects.targets.pick=per_visit",
                                       "--set",    "objects.targets.balance=true",
                                       "--set",    "total_captures=8"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments, folder.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
    return outcome.errors;
  };
  start("whole", {});
  for (const char* shard : {"3/3", "1/3", "2/3"}) start("shards", {"--shard", shard});
  CHECK(difference(tree(folder / "whole"), tree(folder / "shards")) == "");
  CHECK_THAT(
      start("few", {"--set", "objects.targets.pick=per_job", "--set", "objects.targets.count=1"}),
      ContainsSubstring("objects 'targets': 4 of 5 assets are left out"));
}

TEST_CASE("Lint sets scenes up anew and finds what was lifted, pushed into something or moves",
          "[run][settle]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", R"(
seed: 3
total_captures: 2
environments: [{type: shapes, shapes: [cube]}]
objects: [{type: shapes, shapes: [cube], name: things, under: /Assets, label: thing, count: 4}]
cameras: [{type: pinhole, name: cam, width: 64, height: 48}]
lights: [{type: dome, name: sky}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.35, 0.35], [-0.35, 0.35], [1.2, 1.6]], scale: 0.12}
  - {type: orbit_cameras, name: view, on: [dropped], nodes: "/Cameras/*", targets: "/Assets/*",
     distance: 2, polar_angle_deg: 50}
renderer: {type: "null"}
timeline: [{simulate: {until: rest, at_most: 800}}, {capture: dropped}]
writers: [{type: PoseWriter, name: pose}]
)");
  const Outcome outcome = run({"run", "job.yaml", "--output", "out"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const Outcome clean = run({"lint", "--scenes", "out"}, folder.path());
  INFO(clean.output << clean.errors);
  REQUIRE(clean.exit_code == 0);
  CHECK_THAT(clean.output, ContainsSubstring("settle: scenes, 2 files,"));

  const fs::path file = fs::directory_iterator(folder / "out/settle")->path();
  const std::string before = read_file(file);
  const auto lint_with = [&](const auto& change) {
    nlohmann::json json = nlohmann::json::parse(before);
    change(json);
    write_file(file, json.dump(1));
    const Outcome lint = run({"lint", "--scenes", "out"}, folder.path());
    CHECK(lint.exit_code == 7);
    return lint.output;
  };
  const auto pose_of = [](nlohmann::json& json, std::size_t object,
                          const char* list = "placed") -> nlohmann::json& {
    for (auto& placed : json[list]) {
      if (placed["node"] == json["objects"][object]["object"]) return placed["parent_from_node"];
    }
    throw std::runtime_error("the object was never placed");
  };
  const auto lift = [&](nlohmann::json& json, double by) {
    json["objects"][0].erase("before_last_step");
    auto& pose = pose_of(json, 0);
    pose[11] = pose[11].template get<double>() + by;
  };
  CHECK_THAT(lint_with([&](auto& json) { lift(json, 0.03); }),
             ContainsSubstring(": hangs in the air"));
  CHECK_THAT(lint_with([&](auto& json) {
               json["objects"][0].erase("before_last_step");
               for (const int i : {3, 7, 11}) {
                 pose_of(json, 0)[i] = pose_of(json, 1)[i].template get<double>() + 0.02;
               }
             }),
             ContainsSubstring(": is stuck in /Assets/"));
  CHECK_THAT(lint_with([&](auto& json) {
               for (const int i : {3, 7, 11}) {
                 pose_of(json, 0, "born")[i] =
                     pose_of(json, 1, "born")[i].template get<double>() + 0.02;
               }
             }),
             ContainsSubstring("objects begin clear of everything"));
  CHECK_THAT(lint_with([&](auto& json) {
               auto& place = json["objects"][0]["before_last_step"];
               place[0] = place[0].template get<double>() + 0.002;
             }),
             ContainsSubstring(": moves at 0.12 m/s; right would be: at most 0.05 m/s"));
  CHECK_THAT(lint_with([&](auto& json) { json["visit"] = 9; }),
             ContainsSubstring("is of visit 9; right would be: the job has visits 0 to"));
  CHECK_THAT(lint_with([&](auto& json) { json["objects"][1]["object"] = "/Assets/nothing"; }),
             ContainsSubstring("/Assets/nothing: is no object of the visit"));
  CHECK_THAT(lint_with([&](auto& json) {
               json["placed"][0]["parent_from_node"] = {1, 2};
             }),
             ContainsSubstring("parent_from_node is no list of 12 numbers"));
  const Outcome inside =
      run({"run", "job.yaml", "--output", "inside", "--set", "randomizers.view.distance=0.01",
           "--set", "randomizers.view.avoid_obstacles=false"},
          folder.path());
  REQUIRE(inside.exit_code == 0);
  const Outcome cameras = run({"lint", "--scenes", "inside"}, folder.path());
  CHECK(cameras.exit_code == 7);
  CHECK_THAT(cameras.output, ContainsSubstring("cameras stand clear of everything"));
  CHECK_THAT(cameras.output, ContainsSubstring(": stands in /Assets/"));
}
