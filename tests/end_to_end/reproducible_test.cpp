// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <utility>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

std::vector<std::string> smoke(const std::string& output, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments{"run", config_file("smoke.yaml"), "--output", output};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::map<std::string, std::string> dataset(const TemporaryFolder& folder,
                                           std::vector<std::string> more = {}) {
  const Outcome outcome = run(smoke("out", std::move(more)), folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  return tree(folder / "out");
}

}  // namespace

TEST_CASE("A run leaves a whole dataset, no warnings, and a summary", "[run]") {
  const TemporaryFolder folder;
  const Outcome outcome = run(smoke("out"), folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  CHECK_THAT(outcome.errors, !ContainsSubstring("warning"));
  CHECK_THAT(outcome.errors,
             ContainsSubstring("Finished, captured 8 frames (4 captures x 2 cameras)"));
  CHECK_THAT(outcome.errors, ContainsSubstring("residual speed"));
  const auto files = tree(folder / "out");
  CHECK(files.contains("dataset.json"));
  CHECK(files.size() > 4 * 2 * 5);
  CHECK_FALSE(fs::exists(folder / "out/.diorama/stage"));
}

TEST_CASE("Two runs, and any number of threads, give the same bytes", "[run]") {
  const TemporaryFolder first;
  const auto expected = dataset(first, {"--threads", "1"});
  for (const char* threads : {"1", "2", "7"}) {
    const TemporaryFolder other;
    const auto files = dataset(other, {"--threads", threads});
    CHECK(difference(expected, files) == "");
  }
}

TEST_CASE("Path-traced datasets are the same bytes for any number of threads", "[run]") {
  const auto with_threads = [](const char* threads) {
    return std::vector<std::string>{"--set", "renderer={type: embree, samples: 4}", "--threads",
                                    threads};
  };
  const TemporaryFolder first;
  const auto expected = dataset(first, with_threads("1"));
  for (const char* threads : {"2", "7"}) {
    const TemporaryFolder other;
    CHECK(difference(expected, dataset(other, with_threads(threads))) == "");
  }
}

TEST_CASE("Any number of visits in flight gives the same bytes", "[run]") {
  // What the default job randomizes, on rooms that need no assets.
  std::string job = read_file(config_file("smoke.yaml"));
  const auto put_behind = [&](const std::string& line, const std::string& more) {
    job.insert(job.find(line) + line.size(), more);
  };
  put_behind("lights:\n", "  - {type: sphere, name: lamp, count: 2, radius_m: 0.1}\n");
  put_behind(
      "randomizers:\n",
      "  - {type: random_colors, name: colors, on: [environment], nodes: \"/Assets/**\"}\n"
      "  - {type: scatter_lights, name: lamps, on: [environment], nodes: \"/Lights/lamp_*\", "
      "offset: [[-1, 1], [-1, 1], [1, 2]], intensity: [500, 2500]}\n"
      "  - {type: dome_light, name: sky, on: [environment], nodes: \"/Lights/sky_*\", "
      "intensity: [500, 1500]}\n");
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", job);
  int runs = 0;
  const auto dataset_with = [&](const std::string& visits, const std::string& threads) {
    const std::string output = "out_" + std::to_string(runs++);
    const Outcome outcome = run(
        {"run", "job.yaml", "--set", "total_captures=9", "--visits-in-flight", visits, "--threads",
         threads, "--output", output, "--set", "renderer={type: embree, mode: real_time}"},
        folder.path());
    INFO(outcome.errors);
    REQUIRE(outcome.exit_code == 0);
    return tree(folder / output);
  };
  const auto expected = dataset_with("1", "1");
  for (const char* visits : {"1", "2", "4"}) {
    for (const char* threads : {"1", "2", "4"}) {
      CAPTURE(visits, threads);
      CHECK(difference(expected, dataset_with(visits, threads)) == "");
    }
  }
}

TEST_CASE("Another seed gives other data", "[run]") {
  const TemporaryFolder first;
  const TemporaryFolder second;
  CHECK(dataset(first) != dataset(second, {"--seed", "99"}));
}

TEST_CASE("Shards into one folder make the dataset of one run", "[run]") {
  const std::vector<std::string> longer{"--set", "total_captures=7"};
  const TemporaryFolder whole;
  const auto expected = dataset(whole, longer);
  const TemporaryFolder folder;
  for (const char* shard : {"2/3", "3/3", "1/3"}) {
    const Outcome outcome =
        run(smoke("out", {"--set", "total_captures=7", "--shard", shard}), folder.path());
    INFO(outcome.errors);
    CHECK(outcome.exit_code == 0);
  }
  CHECK(difference(expected, tree(folder / "out")) == "");
}

TEST_CASE("After kill -9 a resumed run gives the same bytes", "[run]") {
  const std::vector<std::string> longer{"--set", "total_captures=40"};
  const TemporaryFolder whole;
  const auto expected = dataset(whole, longer);
  for (const char* visits : {"1", "4"}) {
    CAPTURE(visits);
    const TemporaryFolder folder;
    const std::vector<std::string> arguments =
        smoke("out", {"--set", "total_captures=40", "--resume", "--visits-in-flight", visits});
    REQUIRE(run_and_kill(arguments, folder.path(), folder / "out", {1, 9, 22}));
    CHECK(journal_entries(folder / "out") < 40);
    const Outcome outcome = run(arguments, folder.path());
    INFO(outcome.errors);
    CHECK(outcome.exit_code == 0);
    CHECK(difference(expected, tree(folder / "out")) == "");
  }
}

TEST_CASE("Ctrl-C and SIGTERM end a run with 130 and leave it resumable", "[run]") {
  const std::vector<std::string> longer{"--set", "total_captures=40"};
  const TemporaryFolder whole;
  const auto expected = dataset(whole, longer);
  for (const auto& [signal, visits] : {std::pair(SIGINT, "1"), {SIGTERM, "4"}}) {
    CAPTURE(signal, visits);
    const TemporaryFolder folder;
    const std::vector<std::string> arguments =
        smoke("out", {"--set", "total_captures=40", "--visits-in-flight", visits});
    Process process(arguments, folder.path());
    REQUIRE(wait_for_captures(folder / "out", 2));
    process.signal(signal);
    const Outcome outcome = process.wait();
    CHECK(outcome.exit_code == 130);
    CHECK_THAT(outcome.errors, ContainsSubstring("interrupted; '--resume' goes on"));
    // Where it is, and what to do next.
    CHECK_THAT(outcome.errors, ContainsSubstring("dataset: out\n"));
    CHECK_THAT(outcome.errors,
               ContainsSubstring("next: the same command with --resume, diorama view out"));
    CHECK_FALSE(fs::exists(folder / "out/.diorama/stage"));
    std::vector<std::string> resumed = arguments;
    resumed.emplace_back("--resume");
    CHECK(run(resumed, folder.path()).exit_code == 0);
    CHECK(difference(expected, tree(folder / "out")) == "");
  }
}

TEST_CASE("Ctrl-C and SIGTERM are felt inside a picture, which is not written", "[run]") {
  // Minutes of paths, minutes of label rays: none of them is waited for.
  const std::string paths =
      "{type: embree, samples: 1000000, denoise: false}, cameras: [{type: pinhole, name: cam, "
      "width: 64, height: 48}]";
  const std::string labels =
      "{type: \"null\"}, cameras: [{type: pinhole, name: cam, width: 12000, height: 9000}]";
  for (const int signal : {SIGINT, SIGTERM}) {
    for (const std::string& slow : {paths, labels}) {
      const TemporaryFolder folder;
      const std::string writer = slow == paths ? "rgb: true" : "distance_to_camera: true";
      write_file(folder / "job.yaml",
                 "{total_captures: 1, environments: [{type: shapes, shapes: [sphere]}], lights: "
                 "[{type: dome, name: sky}], timeline: [{capture: shot, count: 1}], writers: "
                 "[{type: BasicWriter, name: basic, " +
                     writer + "}], renderer: " + slow + "}");
      Process process({"run", "job.yaml", "--output", "out"}, folder.path());
      for (int i = 0; i < 60000 && !fs::exists(folder / "out"); ++i) ::usleep(1000);
      ::usleep(500000);
      process.signal(signal);
      const Outcome outcome = process.wait();
      CAPTURE(signal, slow, outcome.errors);
      CHECK(outcome.exit_code == 130);
      CHECK_THAT(outcome.errors, ContainsSubstring("interrupted; '--resume' goes on"));
      CHECK(journal_entries(folder / "out") == 0);
      for (const auto& [name, text] : tree(folder / "out")) {
        CHECK_THAT(name, !ContainsSubstring(".png"));
        CHECK_THAT(name, !ContainsSubstring(".npy"));
      }
    }
  }
}

TEST_CASE("An existing dataset is neither mixed up nor lost by accident", "[run]") {
  const TemporaryFolder folder;
  const auto expected = dataset(folder);
  const Outcome again = run(smoke("out"), folder.path());
  CHECK(again.exit_code == 6);
  CHECK_THAT(again.errors, ContainsSubstring("already holds a dataset with 4 captures"));
  const Outcome other = run(smoke("out", {"--resume", "--seed", "8"}), folder.path());
  CHECK(other.exit_code == 6);
  CHECK_THAT(other.errors, ContainsSubstring("differs in: seed"));
  CHECK(difference(expected, tree(folder / "out")) == "");
  CHECK(run(smoke("out", {"--resume"}), folder.path()).exit_code == 0);
  CHECK(difference(expected, tree(folder / "out")) == "");
  CHECK(run(smoke("out", {"--overwrite"}), folder.path()).exit_code == 0);
  CHECK(difference(expected, tree(folder / "out")) == "");
}

TEST_CASE("One more randomizer leaves the draws of the others as they were", "[run]") {
  const TemporaryFolder folder;
  const auto before = dataset(folder);
  std::string job = read_file(config_file("smoke.yaml"));
  const std::string list = "randomizers:\n";
  job.insert(job.find(list) + list.size(),
             "  - {type: random_colors, name: first, on: [environment, dropped], nodes: "
             "\"/Assets/**\"}\n");
  write_file(folder / "more.yaml", job);
  const Outcome outcome = run({"run", "more.yaml", "--output", "more"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  int compared = 0;
  for (const auto& [name, text] : tree(folder / "more")) {
    // Colours change, what follows from poses does not.
    const bool is_geometry = name.find("camera_params") != std::string::npos ||
                             name.find("distance_to_image_plane") != std::string::npos;
    if (!is_geometry) continue;
    ++compared;
    CHECK(before.at(name) == text);
  }
  CHECK(compared >= 16);
}

TEST_CASE("The resolved job gives the dataset of the job", "[run]") {
  const TemporaryFolder folder;
  const auto expected = dataset(folder);
  const Outcome config = run({"config", config_file("smoke.yaml")}, folder.path());
  REQUIRE(config.exit_code == 0);
  write_file(folder / "resolved.yaml", config.output);
  const Outcome outcome = run({"run", "resolved.yaml", "--output", "again"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  CHECK(difference(expected, tree(folder / "again")) == "");
}

TEST_CASE("Memory does not grow from the third visit on", "[run][slow]") {
  const TemporaryFolder folder;
  const auto peak_of = [&](const char* captures, const char* visits, const char* output) {
    // A long run puts more threads to work than a short one, and each holds memory of its own.
    const Outcome outcome =
        run(smoke(output, {"--threads", "2", "--queue-mib", "1", "--visits-in-flight", visits,
                           "--set", std::string("total_captures=") + captures}),
            folder.path());
    REQUIRE(outcome.exit_code == 0);
    return outcome.max_rss_kb;
  };
  // Two captures per visit.
  const long after_3 = peak_of("6", "1", "a");
  const long after_40 = peak_of("80", "1", "b");
  INFO("peak after 3 visits " << after_3 << " kB, after 40 visits " << after_40 << " kB");
  // 37 visits that each kept as little as their pictures (64 x 48 pixels in two cameras, with ids,
  // distances and colour, some 100 kB) would add 3.7 MB. Half of that is left to the allocator.
  CHECK(after_40 < after_3 + 1850);
  // Each visit in flight takes no more than a run by itself.
  CHECK(peak_of("80", "4", "c") < 4 * after_40);
}
