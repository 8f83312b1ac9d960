// SPDX-License-Identifier: Apache-2.0
// What the page says of a run, against what runs write.
#include "framework/view/run_records.h"

#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "framework/output/dataset_status.h"
#include "framework/output/journal.h"
#include "framework/output/workers.h"
#include "framework/pipeline/settling.h"
#include "framework/pipeline/view_report.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace diorama;

namespace {

using OrderedJson = nlohmann::ordered_json;

ViewOutcome outcome(int draws, std::map<std::string, int> refused) {
  return {"cam", draws, std::move(refused), {}, {}};
}

DatasetStatus status_of(int captures, const std::vector<std::string>& living = {},
                        const std::vector<std::string>& dead = {}) {
  DatasetStatus status;
  status.captures = captures;
  for (const std::string& name : living) status.workers.push_back({name, "auto", "", true});
  for (const std::string& name : dead) status.workers.push_back({name, "auto", "", false});
  return status;
}

}  // namespace

TEST_CASE("Refused views are counted once per capture, as captures come", "[view]") {
  test::TemporaryFolder folder;
  LocalFileSystem file_system;
  file_system.make_folders(folder.path(".diorama/journal"));
  JournalWriter writer(file_system, folder.path(".diorama/journal"), "one", ".");
  const auto publish = [&](int capture, const ViewOutcome& one) {
    writer.commit(capture, {{}, {{"", outcomes_json({one})}, {"coco", "not of the run"}}});
    writer.published(capture);
  };
  RunRecords records(folder.path(""));
  records.refresh(status_of(3), true);
  CHECK(records.json().empty());
  publish(0, outcome(3, {{"seen.targets", 2}}));
  records.refresh(status_of(3), true);
  records.refresh(status_of(3), true);
  CHECK(records.json()["views"] ==
        OrderedJson::parse(R"({"views":1,"draws":3,"refused":{"seen.targets":2},"unmet":0})"));
  ViewOutcome unmet = outcome(8, {{"seen.targets", 4}, {"seen.distance_m", 4}});
  unmet.unmet = {"seen.distance_m"};
  publish(2, unmet);
  // Staged is not yet made.
  writer.commit(1, {{}, {{"", outcomes_json({outcome(100, {})})}}});
  records.refresh(status_of(3), true);
  CHECK(records.json()["views"] ==
        OrderedJson::parse(
            R"({"views":2,"draws":11,"refused":{"seen.distance_m":4,"seen.targets":6},)"
            R"("unmet":1})"));
}

TEST_CASE("The last captures of all workers, and where their time goes", "[view]") {
  test::TemporaryFolder folder;
  LocalFileSystem file_system;
  file_system.make_folders(folder.path(".diorama/journal"));
  JournalWriter one(file_system, folder.path(".diorama/journal"), "one", ".");
  JournalWriter two(file_system, folder.path(".diorama/journal"), "two", ".");
  for (const int capture : {0, 1, 2}) {
    one.commit(capture, {});
    one.published(capture);
  }
  two.commit(7, {});
  two.published(7);
  two.commit(8, {});
  folder.write(".diorama/stage/one/times.json", R"({"rendering": 2.5, "loading": 1})");
  folder.write(".diorama/stage/two/times.json", R"({"rendering": 0.5, "x": "y"})");
  folder.write(".diorama/stage/three/times.json", R"({"rendering": )");
  RunRecords records(folder.path(""));
  records.refresh(status_of(10, {"one", "two", "three", "four"}), false);
  CHECK(records.json()["last"] == OrderedJson({2, 7, 1, 0}));
  CHECK(records.json()["stages"] == OrderedJson::parse(R"({"loading":1.0,"rendering":3.0})"));
  // One has died, and leaves its file; one has no lease any more; one is not what a worker writes.
  folder.write(".diorama/stage/three/times.json",
               R"({"rendering": 100, "x": ")" + std::string(std::size_t(64) << 10, 'y') + "\"}");
  records.refresh(status_of(10, {"two", "three"}, {"one"}), false);
  CHECK(records.json()["stages"] == OrderedJson::parse(R"({"rendering":0.5})"));
  records.refresh(status_of(10), false);
  CHECK_FALSE(records.json().contains("stages"));
}

TEST_CASE("Verdicts of settling are counted by reason, other files passed over", "[view]") {
  test::TemporaryFolder folder;
  VisitReport report;
  report.visit = 4;
  report.falling_objects = 7;
  report.rest_after_s = 1.5;
  report.respawned = {{"/Assets/a", "moves at 0.65 m/s."}, {"/Assets/b", "moves at 12 m/s."}};
  report.cameras = {{"/Cameras/c", "is inside of something"}};
  folder.write("settle/4_room.json", settle_json(report));
  for (const char* text : {"", "{", "[]", "{\"visit\":1}", "{\"visit\":\"x\"}"}) {
    folder.write("settle/bad.json", text);
    RunRecords records(folder.path(""));
    records.refresh(status_of(1), false);
    const OrderedJson settle = records.json()["settle"];
    CHECK(settle["visits"] == 1);
    CHECK(settle["at_rest"] == 1);
    CHECK(settle["longest_rest_s"] == 1.5);
    REQUIRE(settle["verdicts"].size() == 2);
    CHECK(settle["verdicts"][0]["first"] == "visit 4: /Cameras/c is inside of something");
    CHECK(settle["verdicts"][1] ==
          OrderedJson::parse(R"({"kind":"respawned","why":"moves at … m/s.","count":2,)"
                             R"("first":"visit 4: /Assets/a moves at 0.65 m/s."})"));
    report.visit = 5;
    report.rest_after_s.reset();
    folder.write("settle/5_room.json", settle_json(report));
    records.refresh(status_of(1), false);
    CHECK(records.json()["settle"]["falling_objects"] == 14);
    CHECK(records.json()["settle"]["at_rest"] == 1);
    CHECK(records.json()["settle"]["verdicts"][1]["count"] == 4);
    LocalFileSystem().remove_file(folder.path("settle/5_room.json"));
    report.visit = 4;
    report.rest_after_s = 1.5;
  }
}

TEST_CASE("The memory of a worker is that of who holds its lease", "[view]") {
  test::TemporaryFolder folder;
  folder.write("dataset.json", R"({"captures": 3, "job": ""})");
  LocalFileSystem file_system;
  WorkerIdentity self = this_worker();
  const auto memory = [&] {
    const DatasetStatus status = read_status(file_system, folder.path(""), false);
    REQUIRE(status.workers.size() == 1);
    CHECK(status.workers[0].is_alive);
    return status.workers[0].memory_bytes;
  };
  {
    Workers worker(file_system, folder.path(".diorama"), self, std::chrono::seconds(60));
    worker.join("auto");
    CHECK(memory() > (1U << 20));
    worker.leave();
  }
  // A number that this process has not, as in another container.
  self.process = 1;
  Workers worker(file_system, folder.path(".diorama"), self, std::chrono::seconds(60));
  worker.join("auto");
  CHECK(memory() == 0);
  worker.leave();
}
