// SPDX-License-Identifier: Apache-2.0
#include <sys/resource.h>
#include <sys/stat.h>
#include <sstream>

#include <cstdlib>
#include <string>
#include <utility>

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
  std::size_t errors = 0;
  std::istringstream lines(outcome.errors);
  for (std::string line; std::getline(lines, line);) errors += line.starts_with("error: ") ? 1 : 0;
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
               "unknown key 'total_capture'; did you mean 'total_captures'?");
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

TEST_CASE("Descriptors that are closed at start catch no files", "[streams]") {
  const TemporaryFolder folder;
  const auto smoke = [&](const std::string& output, const std::string& streams) {
    const std::string command = "cd " + folder.path().string() +
                                " && " DIORAMA_PROGRAM
                                " --log-level debug --plugin-dir " DIORAMA_PLUGIN_DIR " run " +
                                config_file("smoke.yaml") + " --output " + output + " " + streams;
    const int status = std::system(("sh -c '" + command + "'").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  REQUIRE(smoke("open", ">log 2>&1") == 0);
  const auto expected = tree(folder / "open");
  REQUIRE(expected.size() > 10);
  for (const char* closed : {"0<&- 1>&- 2>&-", "1>&-", "2>&-", "1>&- 2>&-", "0<&- 2>&-"}) {
    INFO(closed);
    CHECK(smoke("closed", closed) == 0);
    CHECK(difference(expected, tree(folder / "closed")) == "");
    fs::remove_all(folder / "closed");
  }
  // Printing to what was closed is still an error.
  const int status = std::system(DIORAMA_PROGRAM " --version >/dev/null");
  CHECK(WEXITSTATUS(status) == 0);
  const int lost = std::system("sh -c '" DIORAMA_PROGRAM " schema 1>&- 2>/dev/null'");
  CHECK(WEXITSTATUS(lost) == 6);
}

TEST_CASE("A new dataset does not go among files of others", "[errors]") {
  const TemporaryFolder folder;
  write_file(folder / "mine/notes.txt", "x");
  const auto run_into = [&](const std::string& output, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"run", config_file("smoke.yaml"), "--output", output};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments, folder.path());
  };
  const std::string mine = (folder / "mine").string();
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{}, {"--overwrite"}, {"--resume"}, {"--shard", "1/2"}}) {
    const Outcome outcome = run_into("mine", more);
    CHECK(outcome.exit_code == 6);
    CHECK_THAT(outcome.errors, ContainsSubstring("error: " + mine +
                                                 ": holds 'notes.txt', which is "
                                                 "of no dataset; choose a new or empty folder"));
    CHECK(tree(folder / "mine").size() == 1);
  }
  const Outcome root = run_into("/");
  CHECK(root.exit_code == 6);
  CHECK_THAT(root.errors, ContainsSubstring("error: /: holds '"));
  // Hidden files and what file systems put at their root are nobody's.
  fs::create_directories(folder / "volume/lost+found");
  write_file(folder / "volume/.keep", "");
  CHECK(run_into("volume").exit_code == 0);
  CHECK(run_into("volume", {"--resume"}).exit_code == 0);
  write_file(folder / "volume/notes.txt", "x");
  CHECK(run_into("volume", {"--overwrite"}).exit_code == 0);
  CHECK(fs::exists(folder / "volume/notes.txt"));
}

TEST_CASE("Files with names that are no UTF-8 make datasets that are", "[errors]") {
  const TemporaryFolder folder;
  const std::string cube = "#usda 1.0\ndef Cube \"C\"\n{\n    double size = 0.1\n}\n";
  write_file(folder / "things/caf\xE9.usda", cube);
  write_file(folder / "things/caf\xE8.usda", cube);
  write_file(folder / "rooms/sal\xF3n.usda", cube);
  std::string job = job_with("{type: shapes, shapes: [cube, sphere]}",
                             "{type: files, folders: [" + (folder / "rooms").string() + "]}");
  const std::string targets = "{type: shapes, name: targets,";
  job =
      job.replace(job.find(targets), targets.size(),
                  "{type: files, folders: [" + (folder / "things").string() + "], name: targets,");
  write_file(folder / "job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml", "--output", "out"}, folder.path());
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 0);
  CHECK(outcome.errors.find('\xE9') == std::string::npos);
  CHECK_THAT(read_file(folder / "out/dataset.json"), ContainsSubstring("caf\\\\xE9"));
  const Outcome plan = run({"run", "job.yaml", "--plan"}, folder.path());
  CHECK_THAT(plan.output, ContainsSubstring("class: caf\\xE8"));
  const Outcome inspected =
      run({"inspect", "--json", (folder / "rooms/sal\xF3n.usda").string()}, folder.path());
  INFO(inspected.errors);
  CHECK(inspected.exit_code == 0);
  CHECK_THAT(inspected.output, ContainsSubstring("sal\\\\xF3n"));
}

TEST_CASE("A plan for a hundred million captures and a hundred thousand objects", "[errors]") {
  const TemporaryFolder folder;
  std::string job = job_with("total_captures: 4", "total_captures: 100000000");
  job = job.replace(job.find("count: 4"), 8, "count: 100000");
  write_file(folder / "job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml", "--plan"}, folder.path());
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 0);
  CHECK_THAT(outcome.output, ContainsSubstring("visits (50000000)") &&
                                 ContainsSubstring("... 49999000 more in the same order"));
  CHECK(outcome.max_rss_kb < 400 * 1024);
}

TEST_CASE("names that no file system takes are refused before anything is made", "[errors]") {
  const std::string name(201, 'n');
  const std::string job = read_file(config_file("smoke.yaml"));
  const std::string camera = "cameras[0].name: expected a name of up to 200 bytes, found 201";
  expect_error(job, 3, camera, {"--set", "cameras[0].name=" + name});
  const std::string writer = "writers[0].name: expected names of up to 200 bytes, found one of 201";
  expect_error(job, 3, writer, {"--set", "writers[0].name=" + name});
}

TEST_CASE("writers that meet in one folder are refused before anything is made", "[errors]") {
  const std::string own = "writers[0].output_dir: the output folder's own files are there";
  expect_error(read_file(config_file("smoke.yaml")), 3, own, {"--set", "writers[0].output_dir=."});
  const std::string job = job_with("writers:\n", "writers:\n  - {type: BasicWriter, name: a}\n");
  expect_error(job, 3, "writers[1].output_dir: writer 'a' has the same folder; give each its own",
               {"--set", "writers[1].output_dir=./b/../a/"});
}

TEST_CASE("pipes among the files of strangers are not waited for", "[errors]") {
  const TemporaryFolder folder;
  fs::create_directory(folder / "run");
  REQUIRE(::mkfifo((folder / "run/dataset.json").c_str(), 0600) == 0);
  for (const char* command : {"lint", "stats"}) {
    const Outcome outcome = run({command, "run"}, folder.path());
    INFO(outcome.errors);
    CHECK(outcome.exit_code != 0);
    CHECK_FALSE(outcome.errors.empty());
  }
  REQUIRE(::mkfifo((folder / "plugin.so").c_str(), 0600) == 0);
  const Outcome checked = run({"plugins", "check", "plugin.so"}, folder.path());
  CHECK(checked.exit_code == 4);
  CHECK_THAT(checked.output, ContainsSubstring("is no regular file; a plugin is an ELF file"));
  REQUIRE(::mkfifo((folder / "room").c_str(), 0600) == 0);
  write_file(folder / "job.yaml",
             job_with("{type: shapes, shapes: [cube, sphere]}", "{type: files, files: [room]}"));
  const Outcome made = run({"run", "job.yaml"}, folder.path());
  INFO(made.errors);
  CHECK(made.exit_code == 5);
  CHECK_THAT(made.errors, ContainsSubstring("room: cannot be read as a regular file"));
}

TEST_CASE("a limit on the size of files is an error with a message", "[errors]") {
  const TemporaryFolder folder;
  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
  rlimit small = before;
  small.rlim_cur = 10000;
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  const Outcome outcome = run({"run", config_file("smoke.yaml"), "--output", "out"}, folder.path());
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &before) == 0);
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 6);
  CHECK_THAT(outcome.errors, ContainsSubstring("File too large"));
}

TEST_CASE("what cannot be printed is an error of every command", "[errors][streams]") {
  const TemporaryFolder folder;
  for (const char* seed : {"1", "2"}) {
    const Outcome made =
        run({"run", config_file("smoke.yaml"), "--seed", seed, "--output", seed}, folder.path());
    INFO(made.errors);
    REQUIRE(made.exit_code == 0);
  }
  const std::string program = "cd '" + folder.path().string() +
                              "' && '" DIORAMA_PROGRAM
                              "' --log-level error --plugin-dir '" DIORAMA_PLUGIN_DIR "' ";
  for (const std::string command :
       {"--help", "--version", "run --help", "plugins", "plugins --json", "plugins describe cube",
        "plugins describe BasicWriter", "inspect shape:cube", "inspect shape:cube --json",
        "stats 1", "stats 1 --json", "lint 1", "lint 1 --json", "diff 1 2", "schema", "status 1"}) {
    INFO(command);
    const int status = std::system((program + command + " >/dev/full 2>errors").c_str());
    const std::string errors = read_file(folder / "errors");
    if (command == "plugins describe cube") {  // no such component: one error, not two
      CHECK(WEXITSTATUS(status) == 4);
      CHECK(errors.starts_with("error: no component is called 'cube'"));
      continue;
    }
    CHECK(WEXITSTATUS(status) == 6);
    CHECK(errors == "error: cannot write to standard output: No space left on device\n");
  }
}

TEST_CASE("temporary files without a place are one error", "[errors]") {
  const TemporaryFolder folder;
  REQUIRE(run({"run", config_file("smoke.yaml"), "--output", "made"}, folder.path()).exit_code ==
          0);
  write_file(folder / "file", "");
  for (const auto& [place, reason] :
       {std::pair{"none", "No such file or directory"}, std::pair{"file", "Not a directory"}}) {
    const std::string chosen = (folder / place).string();
    for (const std::string command :
         {"verify made", "plugins check " DIORAMA_PLUGIN_DIR "/renderer_null.so"}) {
      INFO(command);
      const std::string line = "cd '" + folder.path().string() + "' && TMPDIR='" + chosen +
                               "' '" DIORAMA_PROGRAM "' --log-level error --plugin-dir '" +
                               DIORAMA_PLUGIN_DIR "' " + command + " >/dev/null 2>errors";
      CHECK(WEXITSTATUS(std::system(line.c_str())) == 6);
      CHECK(read_file(folder / "errors") ==
            "error: " + chosen + ": cannot hold temporary files: " + reason +
                "; set TMPDIR to a folder with space that you may write\n");
    }
  }
}
