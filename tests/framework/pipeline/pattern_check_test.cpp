// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/pattern_check.h"

#include "diorama/node_pattern.h"
#include "jobs.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// Every randomizer has `nodes` and `targets`, a list of patterns.
std::optional<std::vector<ParamSpec>> describe(ComponentKind, std::string_view) {
  ParamSpec nodes;
  nodes.key = "nodes";
  nodes.type = ParamType::Text;
  nodes.unit = kNodePattern;
  ParamSpec targets = nodes;
  targets.key = "targets";
  targets.type = ParamType::TextList;
  ParamSpec file = nodes;
  file.key = "file";
  file.unit = "";
  return std::vector<ParamSpec>{nodes, targets, file};
}

struct Checked {
  std::string diagnostics;
  std::vector<EnvironmentPattern> open;
};

Checked check(const std::string& keys) {
  const Job job =
      job_from(with(good_job(), "{type: scatter_poses, name: poses, on: [environment]}",
                    "{type: scatter_poses, name: poses, on: [environment], " + keys + "}"));
  const std::vector<std::vector<std::string>> assets{{"011_banana.usd", "024_bowl.usd"},
                                                     {"shape:cube"}};
  const CapturePlan plan = plan_captures(job, {{"room", 0}}, assets);
  Diagnostics diagnostics;
  Checked checked;
  checked.open = check_patterns(job, plan, describe, diagnostics);
  for (const std::string& message : diagnostics.messages()) checked.diagnostics += message + "\n";
  return checked;
}

}  // namespace

TEST_CASE("A pattern that fits no node is told with its place and the nearest path", "[patterns]") {
  CHECK_THAT(check(R"(nodes: "/Asset/*")").diagnostics,
             ContainsSubstring("job.yaml:9:") &&
                 ContainsSubstring("randomizers[0].nodes: '/Asset/*' fits no node; did you mean "
                                   "'/Assets/*'?"));
  CHECK_THAT(check(R"(nodes: "/Cameras/cm_1")").diagnostics,
             ContainsSubstring("did you mean '/Cameras/cam_1'?"));
  CHECK_THAT(check(R"(targets: ["/Assets/*", "/Distrctors/*/x"])").diagnostics,
             ContainsSubstring("randomizers[0].targets: '/Distrctors/*/x' fits no node; did you "
                               "mean '/Distractors/*/x'?"));
  // Far from everything: a path all the same.
  CHECK_THAT(check(R"(nodes: "/Quux/*")").diagnostics,
             ContainsSubstring("'/Quux/*' fits no node; the nearest is '/"));
  CHECK_THAT(check(R"(nodes: "/Assets/falling_0123456789")").diagnostics,
             ContainsSubstring("; the nearest is '/Assets/falling_"));
  CHECK_THAT(check(R"(nodes: "/Assets/falling_banan")").diagnostics,
             ContainsSubstring("did you mean '/Assets/falling_banana'?"));
}

TEST_CASE("Patterns that may fit are no complaint", "[patterns]") {
  for (const char* pattern :
       {"/Assets/*", "/Assets", "/**", "/Assets/**", "/Assets/*/mesh/*", "/Cameras/cam_1",
        "/Assets/*banana*", "/Assets/floating_bowl", "/*/falling_*", "/Distractors/*", ""}) {
    INFO(pattern);
    CHECK(check(std::string("nodes: \"") + pattern + "\"").diagnostics.empty());
  }
  CHECK(check(R"(file: "/Asset/*")").diagnostics.empty());
}

TEST_CASE("Texts of the environment's rules are tried when it is there", "[patterns]") {
  const auto open_of = [](const std::string& section) {
    const Job job = job_from(good_job() + section);
    const std::vector<std::vector<std::string>> assets{{"011_banana.usd"}, {"shape:cube"}};
    Diagnostics diagnostics;
    return check_patterns(job, plan_captures(job, {{"room", 0}}, assets), describe, diagnostics);
  };
  const auto open = open_of(
      "environment: {hide: [Lamp, 'Glass*'], hide_in_debug: [_ceiling], box_colliders: [Table], "
      "working_area: Table}\n");
  REQUIRE(open.size() == 4);
  CHECK(open[1].text == "Glass*");
  CHECK(open[1].key == "environment.hide");
  CHECK(open[1].place.line == 14);
  CHECK_FALSE(open[1].is_path);
  CHECK(open[2].key == "environment.box_colliders");
  CHECK(open[3].otherwise == "the working area is centred on the origin");
  CHECK(open_of("debug: true\nenvironment: {hide_in_debug: [_ceiling]}\n").size() == 1);
}

TEST_CASE("Patterns about the environment are tried when it is there", "[patterns]") {
  const Checked checked = check(R"(nodes: "/Environment/**/Tabel*")");
  CHECK(checked.diagnostics.empty());
  REQUIRE(checked.open.size() == 1);
  CHECK(checked.open[0].text == "/Environment/**/Tabel*");
  CHECK(checked.open[0].key == "randomizers[0].nodes");
}
