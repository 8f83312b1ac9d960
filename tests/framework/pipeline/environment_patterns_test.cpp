// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/environment_patterns.h"

#include <memory>

#include "diorama/error.h"
#include "fake_host.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// An environment below /Environment with these nodes.
struct Room {
  Scene scene;
  NodeId node;
  explicit Room(const std::vector<std::string>& names) {
    node = scene.create(scene.create(scene.root(), "Environment"), "room");
    for (const std::string& name : names) {
      scene.create(scene.create(node, name), "mesh");
    }
  }
};

EnvironmentPattern path(const std::string& text, int line = 7) {
  return {text, "randomizers[2].surfaces", SourceLocation{"job.yaml", line, 3}, true,
          "",   LogLevel::Warning};
}

EnvironmentPattern rule(const std::string& text, LogLevel level = LogLevel::Warning) {
  return {text,  "environment.working_area", SourceLocation{"job.yaml", 4, 1},
          false, "the origin is its middle", level};
}

/// What try_in() throws in the first room; the others are what the job has besides.
std::string error_of(EnvironmentPatterns& patterns, const Room& room,
                     const std::vector<const Room*>& others, FakeHost& host) {
  const auto show = [&](const EnvironmentPatterns::Look& look) {
    for (const Room* other : others) {
      if (!look(other->scene, other->node)) return;
    }
  };
  try {
    patterns.try_in(room.scene, room.node, "room.usd", host, show);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Config);
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("What fits in no environment is an error with its place and the nearest path",
          "[patterns]") {
  const Room dining({"TableDining_01", "Chair_02"});
  const Room kitchen({"TableKitchen_07", "Stove"});
  FakeHost host;
  const auto error = [&](const EnvironmentPattern& pattern) {
    EnvironmentPatterns patterns({pattern}, true);
    return error_of(patterns, dining, {&kitchen}, host);
  };
  CHECK(error(path("/Environment/**/TabelDining*")) ==
        "job.yaml:7:3: randomizers[2].surfaces: no node fits '/Environment/**/TabelDining*' in any "
        "environment of the job; did you mean '/Environment/room/TableDining_01'?");
  // The other room has the nearest one.
  CHECK_THAT(error(path("/Environment/*/TabelKitchn*")),
             ContainsSubstring("did you mean '/Environment/room/TableKitchen_07'?"));
  // Far from everything: a path all the same.
  CHECK_THAT(error(path("/Environment/room/Sofa*")),
             ContainsSubstring("; the nearest is '/Environment/room/"));
  CHECK_THAT(error(path("/Environment/room/Chair_02/msh")),
             ContainsSubstring("did you mean '/Environment/room/Chair_02/mesh'?"));
  CHECK(error(rule("TabelDin*g")) ==
        "job.yaml:4:1: environment.working_area: no node's path holds 'TabelDin*g' in any "
        "environment of the job; did you mean '/Environment/room/TableDining_01'?");
  // All of them at once.
  EnvironmentPatterns two({path("/Environment/x"), rule("y"), path("/Environment/**/Stove")}, true);
  const std::string both = error_of(two, dining, {&kitchen}, host);
  CHECK_THAT(both, ContainsSubstring("'/Environment/x'") && ContainsSubstring("holds 'y'") &&
                       !ContainsSubstring("Stove"));
}

TEST_CASE("What fits in some environment is told once of those that lack it", "[patterns]") {
  const Room dining({"TableDining_01"});
  const Room kitchen({"Stove"});
  FakeHost host;
  EnvironmentPatterns patterns({path("/Environment/**/Stove"), rule("Stove", LogLevel::Info)},
                               true);
  int shown = 0;
  const auto show = [&](const EnvironmentPatterns::Look& look) {
    ++shown;
    CHECK_FALSE(look(kitchen.scene, kitchen.node));  // nothing is open any more
  };
  for (int visit = 0; visit < 3; ++visit) {
    patterns.try_in(dining.scene, dining.node, "dining.usd", host, show);
    patterns.try_in(kitchen.scene, kitchen.node, "kitchen.usd", host, show);
  }
  CHECK(shown == 1);
  REQUIRE(host.warnings.size() == 1);
  CHECK(host.warnings[0] ==
        "dining.usd: no node fits '/Environment/**/Stove' (randomizers[2].surfaces)");
}

TEST_CASE("Of the texts that hide things one has to fit, the others are a warning", "[patterns]") {
  const Room dining({"TableDining_01"});
  FakeHost host;
  EnvironmentPatterns some({rule("Table", LogLevel::Info), rule("Tabel", LogLevel::Info)}, true);
  for (int visit = 0; visit < 2; ++visit) CHECK(error_of(some, dining, {}, host).empty());
  REQUIRE(host.warnings.size() == 1);
  CHECK_THAT(host.warnings[0],
             ContainsSubstring("holds 'Tabel' in any environment of the job; did you mean "
                               "'/Environment/room/TableDining_01'?"));
  EnvironmentPatterns none({rule("Tabel", LogLevel::Info), rule("Lamp", LogLevel::Info)}, true);
  CHECK_THAT(error_of(none, dining, {}, host),
             ContainsSubstring("'Tabel'") && ContainsSubstring("'Lamp'"));
}

TEST_CASE("Jobs may ask for warnings where nothing fits anywhere", "[patterns]") {
  const Room dining({"TableDining_01"});
  FakeHost host;
  EnvironmentPatterns patterns({rule("TablePingPong")}, false);
  CHECK(error_of(patterns, dining, {}, host).empty());
  REQUIRE(host.warnings.size() == 1);
  CHECK(host.warnings[0] ==
        "room.usd: no node's path holds 'TablePingPong' (environment.working_area); the origin is "
        "its middle");
}

TEST_CASE("A rule's text is not looked for in the environment's own name", "[patterns]") {
  const Room dining({"TableDining_01"});
  FakeHost host;
  EnvironmentPatterns patterns({rule("room")}, true);
  CHECK_THAT(error_of(patterns, dining, {}, host), ContainsSubstring("holds 'room'"));
}
