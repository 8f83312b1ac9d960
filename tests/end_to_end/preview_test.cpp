// SPDX-License-Identifier: Apache-2.0
// What a preview shows and an estimate says, against the run that it speaks of.
#include <regex>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

constexpr const char* kPreviewJob = R"(
seed: 3
total_captures: 7
environments: [{type: shapes, shapes: [cube]}]
objects: [{type: shapes, name: targets, under: /Assets, count: 3, label_pattern: "^"}]
cameras: [{type: pinhole, name: cam, count: 2, width: 96, height: 64}]
lights: [{type: dome, name: sky}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*", scale: [0.2, 0.4],
     offset: [[-0.8, 0.8], [-0.8, 0.8], [1.1, 2.0]]}
  - {type: orbit_cameras, name: view, on: [still], targets: "/Assets/*", distance: [1.0, 2.0]}
physics: {type: none}
renderer: {samples: 16}
timeline: [{capture: still, count: 3}]
writers: [{type: BasicWriter, name: basic, rgb: true, distance_to_camera: true}]
)";

std::map<std::string, std::string> files_below(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[entry.path().lexically_relative(folder).string()] = read_file(entry.path());
    }
  }
  return files;
}

}  // namespace

TEST_CASE("A preview shows the pictures of the run", "[preview]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", kPreviewJob);
  REQUIRE(run({"run", "job.yaml", "--output", "out"}, folder.path()).exit_code == 0);

  const Outcome few = run({"preview", "job.yaml"}, folder.path());
  INFO(few.errors);
  REQUIRE(few.exit_code == 0);
  const auto quick = files_below(folder / "preview");
  REQUIRE(quick.size() == 6);
  for (const char* name :
       {"000000_still_cam_0.png", "000003_still_cam_1.png", "000006_still_cam_0.png"}) {
    CHECK(quick.contains(name));
    CHECK_THAT(few.output, ContainsSubstring(std::string("preview/") + name + "\n"));
  }
  CHECK_THAT(few.output,
             ContainsSubstring("estimate from 3 captures in 3 visits with 4 of 16 samples: "
                               "7 captures in "));
  CHECK_FALSE(fs::exists(folder / "_out_diorama"));

  // With all samples they are the run's own.
  const Outcome all = run({"preview", "job.yaml", "--samples", "16", "--capture", "5", "--capture",
                           "1", "--dir", "all"},
                          folder.path());
  REQUIRE(all.exit_code == 0);
  CHECK_THAT(all.output, ContainsSubstring("estimate from 2 captures in "));
  const auto written = files_below(folder / "out");
  const auto shown = files_below(folder / "all");
  REQUIRE(shown.size() == 4);
  for (const auto& [name, bytes] : shown) {
    INFO(name);
    CHECK(std::ranges::any_of(written, [&](const auto& file) { return file.second == bytes; }));
  }
}

TEST_CASE("A dry run estimates and leaves nothing", "[preview]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", kPreviewJob);
  const Outcome dry =
      run({"run", "job.yaml", "--dry-run", "--output", "out", "--visits-in-flight", "2"},
          folder.path());
  INFO(dry.errors);
  REQUIRE(dry.exit_code == 0);
  CHECK(files_below(folder.path()).size() == 1);  // the job
  CHECK_THAT(dry.output, ContainsSubstring("visits (3)"));
  std::smatch said;
  REQUIRE(std::regex_search(
      dry.output, said,
      std::regex(
          "estimate from 2 captures in 1 visit with 2 of 16 samples: 7 captures in (?:[0-9.]+ s or "
          "less|about [0-9.]+ s) on [0-9]+ threads?, the disk not counted \\(3 visits of [0-9.]+ "
          "s, [0-9.]+ s a "
          "capture\\), "
          "([0-9]+) kB on disk, [0-9]+ MB of memory for 2 visits at a time\n")));

  REQUIRE(run({"run", "job.yaml", "--output", "out"}, folder.path()).exit_code == 0);
  double size = 0.0;
  for (const auto& [name, bytes] : files_below(folder / "out")) size += double(bytes.size());
  CHECK(std::stod(said[1]) * 1e3 > 0.75 * size);
  CHECK(std::stod(said[1]) * 1e3 < 1.25 * size);
}

TEST_CASE("What a trial meets ends it", "[preview]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", kPreviewJob);
  const Outcome beyond = run({"preview", "job.yaml", "--capture", "7"}, folder.path());
  CHECK(beyond.exit_code == 2);
  CHECK_THAT(beyond.errors, ContainsSubstring("--capture 7: the job has captures 0 to 6"));
  CHECK_FALSE(fs::exists(folder / "preview"));

  std::string job = kPreviewJob;
  write_file(folder / "room.usda", "#usda 1.0\ndef Mesh \"m\" {\n  int[] faceVertexCounts = [3\n");
  const std::string shapes = "{type: shapes, shapes: [cube]}";
  job.replace(job.find(shapes), shapes.size(),
              "{type: files, files: [" + (folder / "room.usda").string() + "]}");
  write_file(folder / "bad.yaml", job);
  CHECK(run({"run", "bad.yaml", "--plan"}, folder.path()).exit_code == 0);
  const Outcome dry = run({"run", "bad.yaml", "--dry-run"}, folder.path());
  CHECK(dry.exit_code == 5);
  CHECK_THAT(dry.errors, ContainsSubstring("room.usda"));

  // Known before the work, which would have ended with the scene.
  write_file(folder / "taken", "");
  for (const char* place : {"taken", "taken/pictures"}) {
    const Outcome nowhere = run({"preview", "bad.yaml", "--dir", place}, folder.path());
    CHECK(nowhere.exit_code == 6);
    CHECK_THAT(nowhere.errors, ContainsSubstring(std::string(place) + ": Not a directory\n"));
  }
  CHECK(run({"preview", "bad.yaml", "--dir", "new/pictures"}, folder.path()).exit_code == 5);
  CHECK_FALSE(fs::exists(folder / "new"));
}
