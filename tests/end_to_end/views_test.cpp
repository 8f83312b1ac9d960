// SPDX-License-Identifier: Apache-2.0
// What the written labels say of views with conditions; nothing here uses the code that judges
// them.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

using Json = nlohmann::json;

/// Shapes float round a cube; each is a class of its own. Most draws show several of them.
std::string job_of_views(const std::string& views, int captures, const std::string& more = "") {
  return R"(
seed: 11
total_captures: )" +
         std::to_string(captures) + R"(
environments: [{type: shapes, shapes: [cube]}]
objects:
  - {type: shapes, name: targets, under: /Assets, count: 10, balance: true, label_pattern: "^"}
cameras: [{type: pinhole, name: cam, width: 64, height: 48}]
lights: [{type: dome, name: sky}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*", scale: [0.1, 0.15],
     offset: [[-0.8, 0.8], [-0.8, 0.8], [1.1, 2.0]]}
  - {type: orbit_cameras, name: view, on: [still], targets: "/Assets/*", distance: [0.6, 2.4],
     polar_angle_deg: [10, 140], look_at_offset: [-0.3, 0.3]}
physics: {type: none}
renderer: {type: "null"}
timeline: [{capture: still, count: 25}]
writers: [{type: WebDatasetWriter, name: web, shard_captures: 7}]
views: [)" +
         views + "]\n" + more;
}

const std::string kConditions = R"(
  {name: seen, targets: "/Assets/*", visible_pixels: {min: 12}, occlusion: {max: 0.4},
   truncation: {max: 0.25}, size_share: {min: 0.05, max: 0.8}, distance_m: {max: 2.2},
   direction_space: world, elevation_deg: {min: -40}, max_tries: 2000,
   quotas: [{of: label, labels: [capsule, cone, cylinder, sphere, cube]},
            {of: distance_m, edges: [0.5, 1.2, 2.2], shares: [1, 3]},
            {of: direction, columns: 4, rows: 2}]}
)";

/// The JSON files of the tar archives of a WebDataset, by capture.
std::map<int, Json> samples(const fs::path& folder) {
  std::map<int, Json> list;
  for (const auto& entry : fs::directory_iterator(folder / "shards")) {
    const std::string tar = read_file(entry.path());
    for (std::size_t at = 0; at + 512 <= tar.size() && tar[at] != '\0';) {
      const std::string name = tar.c_str() + at;
      const std::size_t size = std::stoul(tar.substr(at + 124, 11), nullptr, 8);
      if (name.ends_with(".json")) {
        const Json json = Json::parse(tar.substr(at + 512, size));
        list[json["capture"].get<int>()] = json;
      }
      at += 512 + (size + 511) / 512 * 512;
    }
  }
  return list;
}

struct Seen {
  std::string label;
  double pixels, distance, azimuth, elevation;
  bool holds;
};

Seen seen_of(const Json& object, const Json& picture) {
  const auto number = [](const Json& matrix, int row, int column) {
    return matrix[std::size_t(row)][std::size_t(column)].get<double>();
  };
  const Json& pose = object["world_from_node"];
  double way[3];
  for (int i = 0; i < 3; ++i) {
    double middle = number(pose, i, 3);
    for (int k = 0; k < 3; ++k) {
      middle += number(pose, i, k) * 0.5 *
                (object["bounds_min"][std::size_t(k)].get<double>() +
                 object["bounds_max"][std::size_t(k)].get<double>());
    }
    way[i] = number(picture["world_from_camera"], i, 3) - middle;
  }
  Seen seen;
  seen.label = object["class"];
  seen.pixels = object["visible_px"];
  seen.distance = std::sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
  seen.azimuth = std::atan2(way[1], way[0]) * 180.0 / M_PI;
  if (seen.azimuth < 0.0) seen.azimuth += 360.0;
  seen.elevation = std::asin(way[2] / seen.distance) * 180.0 / M_PI;
  const auto box = object["box"].get<std::vector<double>>();
  const double size = std::max((box[2] - box[0]) / 64.0, (box[3] - box[1]) / 48.0);
  seen.holds = seen.pixels >= 12 && 1.0 - object["visible_share"].get<double>() <= 0.4 + 1e-9 &&
               object["truncation"].get<double>() <= 0.25 + 1e-9 && size >= 0.05 && size <= 0.8 &&
               seen.distance <= 2.2 && seen.elevation >= -40.0;
  return seen;
}

std::map<std::string, std::string> run_views(const std::string& text, const std::string& output,
                                             const TemporaryFolder& folder,
                                             const std::vector<std::string>& more = {}) {
  write_file(folder / "views.yaml", text);
  std::vector<std::string> arguments{"run", "views.yaml", "--output", output};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  return tree(folder / output);
}

}  // namespace

TEST_CASE("Every picture holds the conditions, and quotas are met exactly", "[views]") {
  constexpr int kCaptures = 120;
  const TemporaryFolder folder;
  write_file(folder / "views.yaml", job_of_views(kConditions, kCaptures));
  const Outcome outcome =
      run({"run", "views.yaml", "--output", "out", "--progress", "json"}, folder.path());
  REQUIRE(outcome.exit_code == 0);
  const auto pictures = samples(folder / "out/web");
  REQUIRE(pictures.size() == kCaptures);
  std::map<std::string, int> labels;
  std::map<int, int> cells;
  int near = 0;
  for (const auto& [capture, picture] : pictures) {
    const Seen* main = nullptr;
    std::vector<Seen> all;
    for (const Json& object : picture["objects"]) all.push_back(seen_of(object, picture));
    for (const Seen& one : all) {
      if (one.holds && (!main || one.pixels > main->pixels)) main = &one;
    }
    INFO(capture);
    REQUIRE(main);
    ++labels[main->label];
    if (main->distance < 1.2) ++near;
    CHECK(main->distance >= 0.5);
    const double low = std::sin(-40.0 * M_PI / 180.0);
    const double height = (std::sin(main->elevation * M_PI / 180.0) - low) / (1.0 - low);
    ++cells[int(main->azimuth / 90.0) + 4 * int(height >= 0.5)];
  }
  for (const auto& [label, count] : labels) CHECK(count == kCaptures / 5);
  CHECK(near == kCaptures / 4);
  CHECK(cells.size() == 8);
  for (const auto& [cell, count] : cells) CHECK(count == kCaptures / 8);

  const Json report = Json::parse(read_file(folder / "out/views.json"));
  CHECK(report["views"] == kCaptures);
  CHECK(report["unmet"].empty());
  int refused = 0;
  for (const auto& [condition, count] : report["refused"].items()) refused += count.get<int>();
  CHECK(refused + kCaptures == report["draws"].get<int>());
  const std::size_t last = outcome.output.rfind('\n', outcome.output.size() - 2) + 1;
  CHECK(Json::parse(outcome.output.substr(last))["refused"] == refused);
  CHECK(report["quotas"]["seen.label"]["cone"] == kCaptures / 5);
  CHECK(Json::parse(read_file(folder / "out/dataset.json"))["views"] == "views.json");
  const Outcome stats = run({"stats", "out/web"}, folder.path());
  CHECK_THAT(stats.output, ContainsSubstring("views: 120 of") &&
                               ContainsSubstring("quota seen.distance_m: 0.5 to 1.2: 30, 1.2 to "
                                                 "2.2: 90"));
  CHECK(run({"lint", "out"}, folder.path()).exit_code == 0);
}

TEST_CASE(
    "Views are the same bytes in shards, with other threads, and when captures are made alone",
    "[views]") {
  const TemporaryFolder folder;
  const std::string text = job_of_views(kConditions, 40);
  const auto whole = run_views(text, "whole", folder, {"--threads", "1"});
  for (const char* shard : {"2/2", "1/2"}) {
    run_views(text, "shards", folder, {"--shard", shard, "--threads", "3"});
  }
  CHECK(difference(whole, tree(folder / "shards")) == "");
  const Outcome verified = run({"verify", "whole", "--sample", "3"}, folder.path());
  INFO(verified.errors);
  CHECK(verified.exit_code == 0);
}

TEST_CASE("Views are the same bytes after kill -9 and resume, and are counted once", "[views]") {
  const TemporaryFolder folder;
  const std::string text = job_of_views(kConditions, 60);
  const auto whole = run_views(text, "whole", folder);
  CHECK(whole.contains("web/shards/train-000001.tar"));
  const std::vector<std::string> arguments{"run",      "views.yaml", "--output", "killed",
                                           "--resume", "--threads",  "2"};
  REQUIRE(run_and_kill(arguments, folder.path(), folder / "killed", {1, 17, 38}));
  CHECK(journal_entries(folder / "killed") < 60);
  const Outcome resumed = run(arguments, folder.path());
  INFO(resumed.errors);
  REQUIRE(resumed.exit_code == 0);
  CHECK(difference(whole, tree(folder / "killed")) == "");
}

TEST_CASE("Cameras of a rig share a part of each quota, and KITTI's pairs are linted", "[views]") {
  const TemporaryFolder folder;
  std::string text = job_of_views(R"(
  {name: seen, targets: "/Assets/*", visible_pixels: {min: 12}, distance_m: {max: 2.2},
   direction_space: world, elevation_deg: {min: -40}, max_tries: 2000,
   quotas: [{of: direction, columns: 4, rows: 2}]}
)",
                                  40);
  const std::string camera = "width: 64, height: 48}";
  text.replace(
      text.find(camera), camera.size(),
      "width: 64, height: 48, rig: [{name: left}, {name: right, position: [0.06, 0, 0]}]}");
  const std::string writers = "writers: [";
  text.replace(text.find(writers), writers.size(),
               writers + "{type: KittiWriter, name: kitti, layout: stereo}, ");
  const auto files = run_views(text, "out", folder);
  CHECK(files.contains("kitti/training/image_3/000000.png"));
  const Json report = Json::parse(read_file(folder / "out/views.json"));
  CHECK(report["unmet"].empty());
  for (const auto& [cell, count] : report["quotas"]["seen.direction"].items()) {
    INFO(cell);
    CHECK(count == 10);  // of 80 views
  }
  const Outcome lint = run({"lint", "out"}, folder.path());
  INFO(lint.output);
  CHECK(lint.exit_code == 0);
}

TEST_CASE("A resumed job says nothing anew of captures that it passes", "[views]") {
  const TemporaryFolder folder;
  write_file(folder / "keep.yaml",
             job_of_views(
                 "{name: seen, targets: \"/Assets/*\", distance_m: {max: 0.1}, max_tries: 3}", 25));
  const std::vector<std::string> arguments{"run", "keep.yaml", "--output", "out", "--resume"};
  REQUIRE(run_and_kill(arguments, folder.path(), folder / "out", {5}));
  const Outcome resumed = run(arguments, folder.path());
  CHECK(resumed.exit_code == 0);
  CHECK_THAT(resumed.errors, !ContainsSubstring("views: capture 0 (still)"));
  CHECK_THAT(resumed.errors, ContainsSubstring("views: capture 24 (still)"));
}

TEST_CASE("Blocked cameras are those of the views that stay, also after kill -9", "[views]") {
  const TemporaryFolder folder;
  std::string text = job_of_views(
      "{name: lit, brightness: {min: 0.45, max: 0.46}, count: {min: 0}, max_tries: 400}", 25);
  text.replace(text.find("name: cam, width"), 10, "name: cam, near_m: 0.9,");
  text.replace(text.find("look_at_offset"), 0, "avoid_obstacles: false, ");
  const auto whole = run_views(text, "whole", folder);
  int refused = 0;
  for (const auto& [name, content] : whole) {
    if (name.starts_with("settle/")) refused += int(Json::parse(content)["blocked_cameras"].size());
  }
  CHECK(refused > 0);
  CHECK(refused <= 25);
  const std::vector<std::string> arguments{"run", "views.yaml", "--output", "killed", "--resume"};
  REQUIRE(run_and_kill(arguments, folder.path(), folder / "killed", {9}));
  CHECK(run(arguments, folder.path()).exit_code == 0);
  CHECK(difference(whole, tree(folder / "killed")) == "");
}

TEST_CASE("At the limit a job keeps the nearest view and says so, or ends", "[views]") {
  const TemporaryFolder folder;
  const std::string impossible =
      "{name: seen, targets: \"/Assets/*\", distance_m: {max: 0.1}, max_tries: 7}";
  write_file(folder / "keep.yaml", job_of_views(impossible, 2));
  const Outcome kept = run({"run", "keep.yaml", "--output", "kept"}, folder.path());
  CHECK(kept.exit_code == 0);
  CHECK_THAT(kept.errors, ContainsSubstring("views: capture 0 (still), cam_0: seen.distance_m not "
                                            "met in 7 draws; most failed: seen.distance_m (7 of "
                                            "7)"));
  CHECK_THAT(kept.errors, ContainsSubstring("2 views do not hold what 'views' asks for"));
  const Json report = Json::parse(read_file(folder / "kept/views.json"));
  CHECK(report["unmet"].size() == 2);
  CHECK(report["unmet"][0]["conditions"][0] == "seen.distance_m");
  // The one that is kept was not refused.
  CHECK(report["draws"] == 2 * 7);
  CHECK(report["refused"] == Json{{"seen.distance_m", 2 * 6}});

  write_file(folder / "stop.yaml",
             job_of_views(impossible.substr(0, impossible.size() - 1) + ", at_limit: stop}", 2));
  const Outcome stopped = run({"run", "stop.yaml", "--output", "stopped"}, folder.path());
  CHECK(stopped.exit_code == 3);
  CHECK_THAT(stopped.errors, ContainsSubstring("seen.distance_m (7 of 7)") &&
                                 ContainsSubstring("'max_tries' (7)") &&
                                 ContainsSubstring("at_limit: keep_best"));
}

TEST_CASE("A label that a room has not got costs no draws", "[views]") {
  const TemporaryFolder folder;
  const auto files = run_views(
      job_of_views("{name: seen, targets: \"/Assets/*\", visible_pixels: {min: 5}, max_tries: 500, "
                   "quotas: [{of: label, labels: [cone, unicorn]}]}",
                   10),
      "out", folder);
  const Json report = Json::parse(files.at("views.json"));
  CHECK(report["unmet"].size() == 5);
  CHECK(report["draws"].get<int>() < 10 * 50);
  CHECK(report["unmet"][0]["conditions"][0] == "seen.quotas.label (no unicorn here)");
}

TEST_CASE("Views are as bright as a job wants them", "[views]") {
  const TemporaryFolder folder;
  const auto files = run_views(
      job_of_views(
          "{name: lit, brightness: {min: 0.35, max: 0.6}, count: {min: 0}, max_tries: 300}", 12),
      "out", folder);
  const Json report = Json::parse(files.at("views.json"));
  CHECK(report["unmet"].empty());
  CHECK(report["refused"]["lit.brightness"].get<int>() > 0);
  const Json stats = Json::parse(run({"stats", "out/web", "--json"}, folder.path()).output);
  CHECK(stats["brightness"]["least"].get<double>() >= 0.35 - 1e-3);
  CHECK(stats["brightness"]["most"].get<double>() <= 0.6 + 1e-3);
}

TEST_CASE("Without views nothing changes", "[views]") {
  const TemporaryFolder folder;
  const auto without = run_views(job_of_views("", 3), "without", folder);
  CHECK_FALSE(without.contains("views.json"));
  // A rule that everything holds draws nothing anew.
  const auto with = run_views(job_of_views("{name: any, count: {min: 0}}", 3), "with", folder);
  CHECK(without.at("web/shards/train-000000.tar") == with.at("web/shards/train-000000.tar"));
  CHECK(Json::parse(with.at("views.json"))["draws"] == 3);
}

TEST_CASE("Wrong patterns and labels in views are named before anything is loaded", "[views]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", job_of_views("{name: seen, targets: \"/Asset/*\"}", 2));
  const Outcome outcome = run({"run", "job.yaml", "--plan"}, folder.path());
  CHECK(outcome.exit_code == 3);
  CHECK_THAT(outcome.errors, ContainsSubstring("views[0].targets: '/Asset/*' fits no node; did you "
                                               "mean '/Assets/*'?"));
  write_file(folder / "job.yaml", job_of_views("{name: seen, labels: [sphera]}", 2));
  CHECK_THAT(run({"run", "job.yaml", "--plan"}, folder.path()).errors,
             ContainsSubstring("views[0].labels: the job labels no object 'sphera'; did you mean "
                               "'sphere'?"));
}
