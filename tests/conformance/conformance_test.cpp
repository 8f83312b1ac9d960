// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/conformance.h"

#include <filesystem>
#include <map>

#include "diorama/abi.h"
#include "framework/conformance/fingerprint.h"
#include "framework/conformance/isolated.h"
#include "framework/conformance/sample_scene.h"
#include "support/catch.h"
#include "support/plain_host.h"

using namespace diorama;
using namespace diorama::conformance;

namespace {

using Results = std::vector<CheckResult>;

Results checked(const std::string& module) {
  return check_plugin(DIORAMA_CONFORMANCE_PLUGINS "/" + module + ".so",
                      [](LogLevel, std::string_view) {});
}

/// The failures of one subject: check and message.
std::map<std::string, std::string> failures(const Results& results, const std::string& subject) {
  std::map<std::string, std::string> failed;
  for (const CheckResult& result : results) {
    if (result.subject == subject && result.outcome == Outcome::Failed) {
      failed.emplace(result.check, result.message);
    }
  }
  return failed;
}

const CheckResult& result_of(const Results& results, const std::string& check) {
  const auto found = std::ranges::find(results, check, &CheckResult::check);
  REQUIRE(found != results.end());
  return *found;
}

}  // namespace

TEST_CASE("writers that break a promise are found out", "[conformance]") {
  const Results results = checked("misbehaving_writers");
  using Failures = std::map<std::string, std::string>;
  CHECK(
      failures(results, "writer/counts_instead") ==
      Failures{{"captures may come in any order, on two threads", "differs from captures in order"},
               {"several threads may write at once",
                "writes something else when several threads write at once"}});
  CHECK(
      failures(results, "writer/keeps_the_time") ==
      Failures{{"the same captures give the same bytes", "differs the second time"},
               {"captures may come in any order, on two threads", "differs from captures in order"},
               {"what finish() writes follows from the records",
                "differs when another process wrote the captures"},
               {"another process gives the same",
                "differs in a process with other addresses, another time and other environment "
                "variables"}});
  CHECK(failures(results, "writer/changes_captures") ==
        Failures{{"captures are written and left as they were", "changes the captures"}});
  CHECK(failures(results, "writer/needs_frames") ==
        Failures{{"a capture without frames is survived", "there is nothing to write"}});
  CHECK(failures(results, "writer/leaves_its_folder")["a dataset without captures is survived"] ==
        "writes '../stolen.txt', which lies outside of its folder");
  CHECK(
      failures(results, "writer/one_name_for_all")["captures are written and left as they were"] ==
      "writes 'picture.txt' twice");
  CHECK(failures(results, "writer/wants_more").empty());
  CHECK(result_of(results, "captures are written").outcome == Outcome::Skipped);
  CHECK(result_of(results, "captures are written").message ==
        "needs 'edges', which another plugin makes");
  CHECK(failures(results, "writer/writes_by_itself") ==
        Failures{{"nothing is printed", "prints to standard output: I am here"},
                 {"no files are left behind", "leaves files behind: by_itself.txt"}});
  CHECK(failures(results, "misbehaving_writers.so").empty());
  CHECK_FALSE(std::filesystem::exists("by_itself.txt"));
}

TEST_CASE("components of the other kinds that break a promise are found out", "[conformance]") {
  const Results results = checked("misbehaving_others");
  auto forgetful = failures(results, "randomizer/forgetful");
  CHECK(forgetful["parameters are documented"] ==
        "the help of 'width' is no sentence with a full stop");
  CHECK(forgetful["a capture does not depend on the captures before"].starts_with(
      "remembers earlier calls: /Assets/box, /Assets/pair"));
  auto loader = failures(results, "loader/takes_anything");
  CHECK(loader["claims are endings, schemes and beginnings, and the listed ones"] ==
        "claims 'Shelf:', expected lower case");
  CHECK(loader["a missing asset is an error that names it"] ==
        "accepts '/nowhere/missing.any', expected an error");
  CHECK(loader["a file that is not what its ending says is an error that names it"].starts_with(
      "accepts '"));
  CHECK(loader["the same asset gives the same nodes, and nothing else is touched"] ==
        "adds nodes beside the one that it was given");
  auto physics = failures(results, "physics/moves_the_floor");
  CHECK(physics["bodies fall onto the floor, all else stays"].starts_with("changes /Environment/"));
  auto renderer = failures(results, "renderer/restless");
  CHECK(renderer["an empty scene gives every channel and is left as it was"] ==
        "channel 'distance_to_camera' has a value where nothing was hit");
  CHECK(renderer["ids, misses and coverage are as conventions.md has them"] ==
        "does not show a box before the camera");
  CHECK(renderer["the same seed gives the same bytes for any number of threads, the scene stays"] ==
        "changes the scene: the tree of nodes");
  auto annotator = failures(results, "annotator/promises_edges");
  CHECK(annotator["a frame that shows nothing is survived"].starts_with(
      "/camera: there is no channel 'edges'; there are: "));
}

TEST_CASE("a crash fails the check in which it happens", "[conformance]") {
  const Results results = checked("crashes_in_write");
  const CheckResult& crash = result_of(results, "a capture without frames is survived");
  CHECK(crash.outcome == Outcome::Failed);
  CHECK(crash.subject == "writer/crashes");
#if !DIORAMA_DETAIL_ADDRESS_SANITIZER  // which ends the process by itself
  CHECK(crash.message == "crashes: Segmentation fault");
#endif
}

TEST_CASE("builds with AddressSanitizer find leaks", "[conformance]") {
  const Results results = checked("leaks");
  const auto end = std::ranges::find_if(results, [](const CheckResult& result) {
    return result.subject == "writer/leaks" &&
           result.check == "all is given back, the process ends well";
  });
  REQUIRE(end != results.end());
#if DIORAMA_DETAIL_ADDRESS_SANITIZER
  CHECK(end->outcome == Outcome::Failed);
  CHECK(end->message.starts_with("ends with code "));
#else
  CHECK(end->outcome == Outcome::Passed);
#endif
}

TEST_CASE("isolated checks are told in order, with text of any kind", "[conformance]") {
  const Trial trial = run_isolated("it", [](Journal& journal) {
    const CheckRun run(journal, "a/b");
    run.check("one", [] {});
    run.check("two", [] { require(false, "first line\nsecond line"); });
    run.skip("three", "no reason");
    run.check("four", [] { throw 4; });
    journal.fact("number", "4");
  });
  const Results& results = trial.results;
  CHECK(trial.facts == std::map<std::string, std::string>{{"number", "4"}});
  REQUIRE(results.size() == 7);
  CHECK(results[0].outcome == Outcome::Passed);
  CHECK(results[1].message == "first line\nsecond line");
  CHECK(results[2].outcome == Outcome::Skipped);
  CHECK(results[3].message == "threw something that is no std::exception");
  CHECK(results[4].subject == "it");
  CHECK(results[6].outcome == Outcome::Passed);
}

TEST_CASE("fingerprints see every change", "[conformance]") {
  const std::string before = fingerprint(sample_scene());
  CHECK(before == fingerprint(sample_scene()));
  Scene scene = sample_scene();
  const NodeId box = scene.require("/Assets/box");
  auto material = std::make_shared<Material>(*scene[box].materials.front());
  material->roughness += 0.01f;
  scene.edit(box).materials.front() = material;
  CHECK(before != fingerprint(scene));
  CHECK(changed_nodes(sample_scene(), scene) == std::vector<std::string>{"/Assets/box"});

  test::PlainHost host;
  const Frame frame = painted_frame(scene, cameras_of(scene).front(), host);
  Frame other = painted_frame(scene, cameras_of(scene).front(), host);
  CHECK(fingerprint(frame) == fingerprint(other));
  other.instances.front().visibility->outside_pixels += 1;
  CHECK(fingerprint(frame) != fingerprint(other));
}

TEST_CASE("painted frames agree with themselves", "[conformance]") {
  test::PlainHost host;
  for (const Capture& capture : sample_captures(2, host)) {
    REQUIRE(capture.frames.size() == 2);
    for (const Frame& frame : capture.frames) {
      CHECK(frame.channels().size() == 12);
      REQUIRE(frame.instances.size() == 2);
      for (const Instance& instance : frame.instances) {
        REQUIRE(instance.tight_box);
        const Visibility& visibility = instance.visibility.value();
        CHECK(visibility.visible_pixels > 0);
        CHECK(visibility.visible_pixels <= visibility.amodal_pixels);
      }
    }
  }
}
