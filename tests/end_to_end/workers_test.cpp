// SPDX-License-Identifier: Apache-2.0
// Several processes on one dataset, and what tells how far it is.
#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

constexpr int kCaptures = 20;  // in ten visits

/// Its cameras are blocked, each view by another distance, and drawn until rules are met: what a
/// visit's report says of its earlier captures.
std::vector<std::string> shared_job(std::vector<std::string> more = {}) {
  std::vector<std::string> arguments{
      "run",
      config_file("smoke.yaml"),
      "--output",
      "out",
      "--set",
      "total_captures=20",
      "--set",
      "cameras[0].near_m=2",
      "--set",
      "views=[{name: high, targets: '/Assets/*', elevation_deg: {min: 30}, max_tries: 5}]"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

const std::map<std::string, std::string>& dataset_of_one_worker() {
  static const std::map<std::string, std::string> files = [] {
    const TemporaryFolder folder;
    REQUIRE(run(shared_job(), folder.path()).exit_code == 0);
    return tree(folder / "out");
  }();
  return files;
}

/// A folder of its own for each process, so that their outputs do not mix; "out" is one for all.
fs::path place_of(const TemporaryFolder& folder, int number) {
  const fs::path place = folder / ("process" + std::to_string(number));
  fs::create_directories(place);
  fs::create_directories(folder / "out");
  fs::create_directory_symlink(folder / "out", place / "out");
  return place;
}

nlohmann::json status_of(const TemporaryFolder& folder) {
  return nlohmann::json::parse(run({"status", "out", "--json"}, folder.path()).output);
}

}  // namespace

TEST_CASE("Shards side by side make the dataset of one run", "[workers]") {
  const TemporaryFolder folder;
  std::vector<Process> processes;
  for (int i = 0; i < 4; ++i) {
    processes.emplace_back(shared_job({"--shard", std::to_string(i + 1) + "/4", "--threads", "1"}),
                           place_of(folder, i));
  }
  for (Process& process : processes) {
    const Outcome outcome = process.wait();
    INFO(outcome.errors);
    CHECK(outcome.exit_code == 0);
  }
  CHECK(difference(dataset_of_one_worker(), tree(folder / "out")) == "");
  CHECK(run({"status", "out"}, folder.path()).exit_code == 0);
}

TEST_CASE("Workers that take visits share a job, also when one of them is killed", "[workers]") {
  const TemporaryFolder folder;
  std::vector<Process> processes;
  for (int i = 0; i < 3; ++i) {
    processes.emplace_back(shared_job({"--shard", "auto", "--threads", "1"}), place_of(folder, i));
  }
  while (!fs::exists(folder / "out/dataset.json")) ::usleep(1000);
  processes[0].signal(SIGKILL);
  for (Process& process : processes) {
    const Outcome outcome = process.wait();
    INFO(outcome.errors);
    if (&process != &processes[0]) CHECK(outcome.exit_code == 0);
  }
  const Outcome last = run(shared_job({"--shard", "auto"}), folder.path());
  INFO(last.errors);
  CHECK(last.exit_code == 0);
  CHECK(difference(dataset_of_one_worker(), tree(folder / "out")) == "");
}

TEST_CASE("A run of a format that ends with its tables is shown before its end", "[workers]") {
  const TemporaryFolder folder;
  const std::string writers = "writers=[{type: CocoWriter, name: coco}]";
  const auto shard = [&](const char* which) {
    return shared_job({"--set", writers, "--threads", "1", "--shard", which});
  };
  // Only where somebody works: another's files are not to say what is done here.
  Process first(shard("1/2"), place_of(folder, 0));
  while (!fs::exists(folder / "out/dataset.json")) ::usleep(1000);
  first.signal(SIGSTOP);
  REQUIRE(run(shard("2/2"), folder.path()).exit_code == 0);
  const auto before = tree(folder / "out");
  const Outcome report = run({"report", "out", "-o", "report"}, folder.path());
  INFO(report.errors);
  CHECK(report.exit_code == 0);
  CHECK(difference(before, tree(folder / "out")) == "");
  const auto files = tree(folder / "report");
  const std::string done = status_of(folder).at("done").dump();
  CHECK_THAT(files.at("data/state.js"), ContainsSubstring("\"captures\":" + done));
  CHECK_THAT(files.at("data/0_info.js"), ContainsSubstring("\"name\":\"coco\""));
  const auto shown = std::ranges::find_if(
      files, [](const auto& file) { return file.first.ends_with("_0_color"); });
  REQUIRE(shown != files.end());
  const std::string capture = shown->first.substr(0, shown->first.size() - 8);
  CHECK_THAT(files.at(capture + ".js"), ContainsSubstring("\"class\":\"sphere\""));

  // A signal leaves nothing among the temporary files, whenever it comes.
  const fs::path temporary = folder / "temporary";
  fs::create_directories(temporary);
  ::setenv("TMPDIR", temporary.c_str(), 1);
  Process stopped({"report", "out", "-o", "stopped"}, place_of(folder, 1));
  for (int i = 0; i < 5000 && fs::is_empty(temporary); ++i) ::usleep(1000);
  stopped.signal(SIGTERM);
  ::unsetenv("TMPDIR");
  const Outcome outcome = stopped.wait();
  INFO(outcome.exit_code << ": " << outcome.errors);
  CHECK((outcome.exit_code == 0 || outcome.exit_code == 130));
  CHECK(fs::is_empty(temporary));

  first.signal(SIGKILL);
  first.wait();
  const Outcome later = run({"report", "out", "-o", "later"}, folder.path());
  CHECK(later.exit_code == 2);
  CHECK_THAT(later.errors, ContainsSubstring("nothing that could be read yet"));
  REQUIRE(run(shard("1/2"), folder.path()).exit_code == 0);
  CHECK(run({"lint", "out"}, folder.path()).exit_code == 0);
}

TEST_CASE("A shard that runs twice ends with 75 and names who has it", "[workers]") {
  const TemporaryFolder folder;
  Process first(shared_job({"--shard", "1/2", "--threads", "1"}), place_of(folder, 0));
  while (!fs::exists(folder / "out/dataset.json")) ::usleep(1000);
  first.signal(SIGSTOP);
  const Outcome second = run(shared_job({"--shard", "1/2"}), folder.path());
  CHECK(second.exit_code == 75);
  CHECK_THAT(
      second.errors,
      ContainsSubstring("another process works on this dataset as shard 1 of 2, too (host ") &&
          ContainsSubstring(", process "));
  CHECK(run(shared_job({"--overwrite"}), folder.path()).exit_code == 75);
  const auto status = status_of(folder);
  CHECK(status.at("finished") == false);
  CHECK(status.at("captures") == kCaptures);
  CHECK(status.at("workers").at(0).at("state") == "alive");
  CHECK(status.at("workers").at(0).at("role") == "shard-1-of-2");
  first.signal(SIGCONT);
  const Outcome outcome = first.wait();
  CHECK(outcome.exit_code == 0);
  CHECK_THAT(outcome.errors, ContainsSubstring("this part is done, the dataset lacks 10 captures"));
  CHECK(run({"status", "out"}, folder.path()).exit_code == 8);
  CHECK(run({"finish", "out"}, folder.path()).exit_code == 8);
  CHECK(run(shared_job({"--shard", "2/2"}), folder.path()).exit_code == 0);
  CHECK(difference(dataset_of_one_worker(), tree(folder / "out")) == "");
}

TEST_CASE("A signal ends a run with the code that the scheduler wants", "[workers]") {
  const TemporaryFolder folder;
  Process process(shared_job({"--stopped-exit-code", "99", "--progress", "json"}), folder.path());
  while (!fs::exists(folder / "out/dataset.json")) ::usleep(1000);
  process.signal(SIGTERM);
  const Outcome outcome = process.wait();
  CHECK(outcome.exit_code == 99);
  CHECK(run(shared_job({"--resume"}), folder.path()).exit_code == 0);
  CHECK(difference(dataset_of_one_worker(), tree(folder / "out")) == "");
}

TEST_CASE("Progress comes as lines for programs", "[workers]") {
  const TemporaryFolder folder;
  const Outcome json = run(shared_job({"--progress", "json"}), folder.path());
  REQUIRE(json.exit_code == 0);
  std::istringstream lines(json.output);
  int done = 0;
  int count = 0;
  std::int64_t refused = 0;  // views
  for (std::string line; std::getline(lines, line); ++count) {
    const auto object = nlohmann::json::parse(line);
    CHECK(object.at("done") >= done);
    done = object.at("done");
    CHECK(object.at("total") == kCaptures);
    CHECK(object.at("rss_mib").get<double>() > 1.0);
    CHECK(object.at("refused") >= refused);
    refused = object.at("refused");
    CHECK(object.contains("per_minute"));
    CHECK(object.contains("seconds_left"));
  }
  CHECK(done == kCaptures);
  CHECK(count >= kCaptures);
  CHECK(refused > 0);
  // Nothing is left to do: said, too.
  const Outcome again = run(shared_job({"--progress", "json", "--resume"}), folder.path());
  REQUIRE(again.exit_code == 0);
  const auto only = nlohmann::json::parse(again.output);
  CHECK(only.at("done") == kCaptures);
  CHECK(only.at("resumed") == kCaptures);
  const Outcome openjd = run(shared_job({"--progress", "openjd", "--overwrite"}), folder.path());
  CHECK_THAT(openjd.output, ContainsSubstring("openjd_progress: 100.0\n") &&
                                ContainsSubstring("openjd_status: 20 of 20 captures\n"));
}

TEST_CASE("What was deleted or damaged is found and made anew", "[workers]") {
  const TemporaryFolder folder;
  REQUIRE(run(shared_job(), folder.path()).exit_code == 0);
  const auto whole = tree(folder / "out");
  CHECK_THAT(whole.at("settle/3_sphere.json"), ContainsSubstring("m from something"));
  // Of the last capture of a visit, with which its report goes, and of what was written before the
  // first one.
  for (const char* ending : {"rgb_0007.png", "metadata.txt"}) {
    CAPTURE(ending);
    std::string file;
    for (const auto& [name, text] : whole) {
      if (name.ends_with(ending)) file = name;
    }
    REQUIRE(!file.empty());
    fs::remove(folder / "out" / file);
    CHECK(run({"status", "out"}, folder.path()).exit_code == 0);
    const Outcome found = run({"status", "out", "--verify"}, folder.path());
    CHECK(found.exit_code == 8);
    CHECK_THAT(found.output, ContainsSubstring(file + ": missing"));
    const Outcome repaired = run(shared_job({"--resume", "--verify"}), folder.path());
    INFO(repaired.errors);
    CHECK(repaired.exit_code == 0);
    CHECK_THAT(repaired.errors, ContainsSubstring("is missing; it is made anew"));
    CHECK(difference(whole, tree(folder / "out")) == "");
    CHECK(run({"status", "out", "--verify"}, folder.path()).exit_code == 0);
  }
  const Outcome replayed = run({"replay", "out", "--capture", "7"}, folder.path());
  INFO(replayed.errors);
  CHECK(replayed.exit_code == 0);
}

TEST_CASE("The next command can be pasted, whatever the folder's name", "[workers]") {
  const TemporaryFolder folder;
  const Outcome outcome = run(
      {"run", config_file("smoke.yaml"), "--output", "it's two words", "--set", "total_captures=1"},
      folder.path());
  REQUIRE(outcome.exit_code == 0);
  CHECK_THAT(outcome.errors, ContainsSubstring(R"(next: diorama lint 'it'\''s two words', )"));
}

TEST_CASE("A dataset whose captures are all there is finished by its own job", "[workers]") {
  const TemporaryFolder folder;
  REQUIRE(run(shared_job(), folder.path()).exit_code == 0);
  // As if the last worker had been killed before the end: nothing says that it is finished.
  for (const auto& entry : fs::directory_iterator(folder / "out/.diorama/journal")) {
    if (entry.path().extension() != ".index") continue;
    const std::string text = read_file(entry.path());
    const std::size_t end = text.rfind("c finish ");
    write_file(entry.path(), text.substr(0, end));
  }
  CHECK(run({"status", "out"}, folder.path()).exit_code == 8);
  const Outcome outcome = run({"finish", "out"}, folder.path());
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 0);
  CHECK(run({"status", "out"}, folder.path()).exit_code == 0);
  CHECK(difference(dataset_of_one_worker(), tree(folder / "out")) == "");
  CHECK(run({"finish", "out"}, folder.path()).exit_code == 0);
}
