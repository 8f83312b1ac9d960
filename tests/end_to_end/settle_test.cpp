// SPDX-License-Identifier: Apache-2.0
// In the smoke job objects fall beside the room, a cube or a sphere, and go on falling.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "framework/lint/dataset_files.h"
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
  CHECK_THAT(dropped.log, ContainsSubstring("had left the room and was taken out"));
}

TEST_CASE("Objects that stay keep their motion when others are dropped", "[run][settle]") {
  const Run run = run_with_policy(
      "drop", {"--set", "total_captures=2", "--set",
               "timeline=[{simulate: 70}, {capture: dropped, count: 1}]", "--set",
               "randomizers.cameras.on=[dropped]", "--set", "writers.basic.motion_vectors=true"});
  REQUIRE(run.reports[1]["dropped"].size() > 0);
  const diorama::lint::NpyArray motion = diorama::lint::parse_npy(
      run.files.at("basic/rp_cam_0/motion_vectors/motion_vectors_0001.npy"));
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
