// SPDX-License-Identifier: Apache-2.0
#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

/// The smoke job with one text replaced.
std::string job_with(const std::string& from, const std::string& to) {
  std::string job = read_file(config_file("smoke.yaml"));
  const std::size_t place = job.find(from);
  if (place == std::string::npos) throw std::logic_error("no \"" + from + "\" in smoke.yaml");
  return job.replace(place, from.size(), to);
}

/// Runs a job that cannot work: the exit code, the message, and nothing left on disk.
void expect_error(const std::string& job, int exit_code, const std::string& message,
                  std::vector<std::string> more = {}) {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", job);
  std::vector<std::string> arguments{"run", "job.yaml"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments, folder.path());
  INFO(outcome.errors);
  CHECK(outcome.exit_code == exit_code);
  CHECK_THAT(outcome.errors, ContainsSubstring(message));
  const std::size_t errors = [&] {
    std::size_t count = 0;
    for (std::size_t at = outcome.errors.find("error: "); at != std::string::npos;
         at = outcome.errors.find("error: ", at + 1)) {
      ++count;
    }
    return count;
  }();
  CHECK(errors == 1);
  const auto left = tree(folder.path());
  CHECK(left.size() == 1);
  CHECK_FALSE(fs::exists(folder / "_out_smoke"));
}

}  // namespace

TEST_CASE("config checks what run checks, but for the assets", "[errors]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", job_with("camera_params: true", "camera_parms: true"));
  const Outcome wrong = run({"config", "job.yaml"}, folder.path());
  CHECK(wrong.exit_code == 3);
  CHECK(wrong.output.empty());
  CHECK_THAT(wrong.errors,
             ContainsSubstring("unknown key 'camera_parms', did you mean 'camera_params'?"));
  write_file(folder / "job.yaml", job_with("{type: shapes, shapes: [cube, sphere]}",
                                           "{type: files, folders: [/no/such/folder]}"));
  const Outcome absent = run({"config", "job.yaml"}, folder.path());
  INFO(absent.errors);
  CHECK(absent.exit_code == 0);
}

TEST_CASE("a job may make missing textures errors", "[errors]") {
  const TemporaryFolder assets;
  write_file(assets / "a.usda",
             "#usda 1.0\ndef Cube \"C\"\n{\n    rel material:binding = </M>\n}\n"
             "def Material \"M\"\n{\n    token outputs:surface.connect = </M/S.outputs:out>\n"
             "    def Shader \"S\"\n    {\n        uniform token info:id = \"UsdPreviewSurface\"\n"
             "        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>\n    }\n"
             "    def Shader \"T\"\n    {\n        uniform token info:id = \"UsdUVTexture\"\n"
             "        asset inputs:file = @gone.png@\n    }\n}\n");
  const std::string job = job_with("{type: shapes, shapes: [cube, sphere]}",
                                   "{type: files, files: [" + (assets / "a.usda").string() + "]}");
  expect_error(job + "loaders: [{type: usd, missing_assets_are_errors: true}]\n", 5,
               "texture @gone.png@ could not be found");
  expect_error(job + "loaders: [{type: usd, missing_assets: true}]\n", 3,
               "unknown key 'missing_assets'");
}

TEST_CASE("A missing job file", "[errors]") {
  const TemporaryFolder folder;
  const Outcome outcome = run({"run", "nowhere.yaml"}, folder.path());
  CHECK(outcome.exit_code == 3);
  CHECK_THAT(outcome.errors, ContainsSubstring("nowhere.yaml"));
}

TEST_CASE("A YAML syntax error has its place", "[errors]") {
  expect_error("seed: 1\ncameras: [{type: pinhole\n", 3, "job.yaml:");
}

TEST_CASE("An unknown key has its place and the nearest name", "[errors]") {
  expect_error(job_with("total_captures", "total_capture"), 3,
               "unknown key `total_capture`; did you mean `total_captures`?");
  expect_error(job_with("camera_params: true", "camera_parms: true"), 3, "camera_parms");
}

TEST_CASE("Wrong types and values out of range say what is allowed", "[errors]") {
  expect_error(job_with("total_captures: 4", "total_captures: many"), 3, "many");
  expect_error(job_with("total_captures: 4", "total_captures: -4"), 3, "-4");
  expect_error(job_with("count: 4", "count: -4"), 3, "objects[0].count");
}

TEST_CASE("Several mistakes come in one message", "[errors]") {
  std::string job = job_with("total_captures: 4", "total_captures: -4");
  job = job.replace(job.find("width: 64"), 9, "widht: 64");
  job = job.replace(job.find("orbit_cameras"), 13, "orbit_camera");
  expect_error(job, 3, "total_captures");
  expect_error(job, 3, "widht");
  expect_error(job, 3, "orbit_camera");
}

TEST_CASE("Captures wanted, but none per environment", "[errors]") {
  std::string job = job_with("{capture: floating, count: 1}", "{capture: floating, count: 0}");
  job = job.replace(job.find("{capture: dropped, count: 1}"), 28, "{capture: dropped, count: 0}");
  expect_error(job, 3, "can never be reached");
}

TEST_CASE("An empty list of environments", "[errors]") {
  expect_error(
      job_with("environments:\n  - {type: shapes, shapes: [cube, sphere]}", "environments: []"), 3,
      "environments: the list is empty");
}

TEST_CASE("A missing asset folder and a missing asset", "[errors]") {
  expect_error(
      job_with("{type: shapes, shapes: [cube, sphere]}", "{type: files, folders: [/no/rooms]}"), 5,
      "/no/rooms");
  expect_error(job_with("{type: shapes, name: targets,",
                        "{type: files, files: [/no/mug.usd], name: targets,"),
               5, "/no/mug.usd");
}

TEST_CASE("Remote assets get advice", "[errors]") {
  expect_error(job_with("{type: shapes, shapes: [cube, sphere]}",
                        "{type: files, files: [\"omniverse://host/room.usd\"]}"),
               5, "omniverse://host/room.usd");
}

TEST_CASE("An output that cannot be written is found at start", "[errors]") {
  const TemporaryFolder folder;
  write_file(folder / "file", "x");
  const Outcome outcome =
      run({"run", config_file("smoke.yaml"), "--output", "file/below"}, folder.path());
  CHECK(outcome.exit_code == 6);
  CHECK_THAT(outcome.errors, ContainsSubstring("file/below") || ContainsSubstring("/file"));
  CHECK(tree(folder.path()).size() == 1);
}

TEST_CASE("Writers that nobody can serve are named at start", "[errors]") {
  expect_error(job_with("type: BasicWriter", "type: BasicWritr"), 3, "BasicWriter");
}

TEST_CASE("Flags that exclude each other", "[errors]") {
  const TemporaryFolder folder;
  const Outcome outcome =
      run({"run", config_file("smoke.yaml"), "--resume", "--overwrite"}, folder.path());
  CHECK(outcome.exit_code == 2);
  CHECK_THAT(outcome.errors, ContainsSubstring("exclude each other"));
}
