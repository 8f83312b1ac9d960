// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <set>
#include <sstream>
#include <string>

#include "diorama/abi.h"
#include "framework/config/yaml_config.h"
#include "program_run.h"
#include "support/catch.h"

using namespace diorama;
using test::run_in_terminal;
using test::run_program;
using test::WorkFolder;

namespace {

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// One complaint per run: a single line that begins with "error: ".
void check_error(const test::ProgramRun& run, int code, const std::string& message) {
  INFO(run.err);
  CHECK(run.code == code);
  CHECK(run.out.empty());
  CHECK(run.err == "error: " + message + "\n");
}

const Value* entry_called(const Value& list, const std::string& type) {
  for (const Value& entry : list.list) {
    if (entry.find("type") && entry.find("type")->scalar == type) return &entry;
  }
  return nullptr;
}

}  // namespace

TEST_CASE("help and version go to standard output and are no errors", "[cli]") {
  for (const char* command : {"", "run", "config", "plugins", "plugins describe", "schema", "docs",
                              "doctor", "inspect"}) {
    const auto run = run_program(std::string(command) + " --help");
    INFO(command);
    CHECK(run.code == 0);
    CHECK(run.err.empty());
    CHECK(has(run.out, "Usage:"));
  }
  const auto version = run_program("--version");
  CHECK(version.code == 0);
  CHECK(version.out.starts_with("diorama "));
  CHECK(has(version.out, "(plugin ABI "));
}

TEST_CASE("lists and descriptions fit narrow terminals", "[cli]") {
  constexpr std::size_t kColumns = 50;
  for (const char* command : {"plugins", "plugins describe CocoWriter", "doctor", "run --help"}) {
    const std::string shown = run_in_terminal(command, int(kColumns));
    INFO(command << "\n" << shown);
    CHECK(std::ranges::count(shown, '\n') > 20);
    std::istringstream lines(shown);
    for (std::string line; std::getline(lines, line);) {
      while (line.ends_with('\r')) line.pop_back();
      // A path has no place to break at.
      const std::size_t word = line.find_first_not_of(' ');
      const bool may_break = word != std::string::npos && line.find(' ', word) != std::string::npos;
      if (may_break && !has(line, "/")) CHECK(line.size() <= kColumns);
    }
  }
  // Elsewhere lines stay whole, for grep.
  CHECK(has(run_program("plugins").out,
            "  empty                    Empty space, as an environment.  [diorama "));
}

TEST_CASE("mistakes on the command line end with code 2", "[cli]") {
  CHECK(run_program("").code == 2);
  CHECK(run_program("fly").code == 2);
  const auto unknown = run_program("run --fast job.yaml");
  CHECK(unknown.code == 2);
  CHECK(unknown.err == "error: unknown option '--fast' (try diorama run --help)\n");
  check_error(run_program("run --overwrit job.yaml"), 2,
              "unknown option '--overwrit'; did you mean '--overwrite'? (try diorama run --help)");
  check_error(run_program("--thread=2 plugins"), 2,
              "unknown option '--thread'; did you mean '--threads'? (try diorama plugins --help)");
  check_error(run_program("rnu job.yaml"), 2,
              "unknown command 'rnu'; did you mean 'run'? (try diorama --help)");
  check_error(run_program("plugins describ quiet"), 2,
              "unknown command 'describ'; did you mean 'describe'? (try diorama plugins --help)");
  check_error(run_program("inspect a.usd b.usd"), 2,
              "nothing takes the argument 'b.usd' (try diorama inspect --help)");
  check_error(run_program(""), 2, "no command is given (try diorama --help)");
  for (const char* seed : {"--seed=-1", "--seed -1", "--seed 0x10", "--seed 1.5",
                           "--seed 18446744073709551616", "--seed ''"}) {
    INFO(seed);
    const auto run = run_program("run a.yaml " + std::string(seed));
    CHECK(run.code == 2);
  }
  CHECK(has(run_program("run a.yaml --seed=-1").err,
            "expected a whole number of 0 to 18446744073709551615, found '-1'"));
  CHECK(run_program("--threads 2000 plugins").code == 2);
  CHECK(run_program("run a.yaml --seed many").code == 2);
  check_error(run_program("--log-level loud plugins"), 2,
              "log level 'loud' is unknown; there are debug, info, warning and error");
  check_error(run_program("run a.yaml --shard 3/2"), 2,
              "--shard: expected 'auto', or i/n with 1 <= i <= n, for instance 2/5, found '3/2'");
  check_error(run_program("run a.yaml --shard 1/2x"), 2,
              "--shard: expected 'auto', or i/n with 1 <= i <= n, for instance 2/5, found '1/2x'");
}

TEST_CASE("mistakes in job files end with code 3 and all of them are named", "[cli]") {
  const WorkFolder folder;
  check_error(run_program("run /nowhere/job.yaml"), 3,
              "/nowhere/job.yaml: no such file; a job is a YAML or JSON file");
  const auto syntax = folder.write("syntax.yaml", "seed: [1\n");
  const auto run = run_program("run " + syntax.string());
  CHECK(run.code == 3);
  CHECK_THAT(run.err, ContainsSubstring(syntax.string() + ":1:7: YAML syntax error: ") &&
                          ContainsSubstring("the '[' that opens here is not closed"));
  const auto wrong = folder.write("wrong.yaml",
                                  "sead: 1\ntotal_captures: -2\nenvironments: [{type: shapes}]\n"
                                  "cameras: [{type: pinhole, width: wide}]\n");
  const auto all = run_program("config " + wrong.string());
  CHECK(all.code == 3);
  CHECK(has(all.err, wrong.string() + ":1:1: unknown key 'sead'; did you mean 'seed'?"));
  CHECK(has(all.err, wrong.string() + ":2:17: total_captures: expected an integer"));
  CHECK(has(all.err, wrong.string() + ":4:34: cameras[0].width: expected an integer"));
  check_error(run_program("config " DIORAMA_SOURCE_DIR "/configs/smoke.yaml --set seed"), 2,
              "--set seed: expected key=value, for instance renderer.samples=64");
  // What a component itself finds wrong has a place, too.
  check_error(run_program("config " DIORAMA_SOURCE_DIR
                          "/configs/smoke.yaml --set 'environments[0]={type: shapes, shapes: "
                          "[cubee]}'"),
              3,
              "--set environments[0]={type: shapes, shapes: [cubee]}:1:1: environments[0]: loader "
              "'shapes': unknown shape 'cubee'; did you mean 'cube'? (known: capsule, cone, "
              "cylinder, sphere, cube)");
  check_error(run_program("config " DIORAMA_SOURCE_DIR
                          "/configs/object_based_default.yaml --set num_frame=3"),
              3, "--set num_frame=3:1:1: unknown key 'num_frame'; did you mean 'num_frames'?");
}

TEST_CASE("config prints a job that means the same again", "[cli]") {
  const std::string smoke = DIORAMA_SOURCE_DIR "/configs/smoke.yaml";
  const auto first =
      run_program("config " + smoke + " --set cameras.0.width=77 --seed 9 --output x");
  REQUIRE(first.code == 0);
  const Value job = parse_yaml(first.out, "first");
  CHECK(job.find("seed")->scalar == "9");
  CHECK(job.find("cameras")->list.at(0).find("width")->scalar == "77");
  CHECK(job.find("output")->find("folder")->scalar == "x");
  const WorkFolder folder;
  const auto again = run_program("config " + folder.write("again.yaml", first.out).string());
  CHECK(again.out == first.out);
  const auto json = run_program("config --json --config " + smoke);
  REQUIRE(json.code == 0);
  const auto from_json = run_program("config " + folder.write("job.json", json.out).string());
  CHECK(from_json.out == run_program("config " + smoke).out);
}

TEST_CASE("plugins are listed for people and for programs", "[cli]") {
  const auto text = run_program("plugins --plugin-dir " DIORAMA_FAULTY_PLUGINS);
  INFO(text.err);
  CHECK(text.code == 0);
  CHECK(has(text.out, "\nwriter\n"));
  CHECK(has(text.out, "Writes nothing.  [well_behaved 1.2.3]"));
  CHECK(has(text.out, DIORAMA_FAULTY_PLUGINS " (--plugin-dir)"));
  CHECK(has(text.out, "\nrefused\n"));
  CHECK(has(text.out, "without_entry.so: has no entry function"));
  const auto json = run_program("plugins --json --plugin-dir " DIORAMA_FAULTY_PLUGINS);
  REQUIRE(json.code == 0);
  const Value list = parse_yaml(json.out, "plugins.json");
  const Value* quiet = entry_called(*list.find("components"), "quiet");
  REQUIRE(quiet);
  CHECK(quiet->find("kind")->scalar == "writer");
  CHECK(quiet->find("version")->scalar == "1.2.3");
  CHECK(quiet->find("file")->scalar == DIORAMA_FAULTY_PLUGINS "/well_behaved.so");
  CHECK(list.find("rejected")->list.size() >= 1);
}

TEST_CASE("a component is described with types, defaults, ranges and units", "[cli]") {
  const std::string plugins = " --plugin-dir " DIORAMA_FAULTY_PLUGINS " 2>/dev/null";
  const auto text = run_program("plugins describe quiet" + plugins);
  CHECK(text.code == 0);
  CHECK(has(text.out, "writer quiet: Writes nothing.\nplugin well_behaved 1.2.3, "));
  CHECK(has(text.out, "\nsize: integer, default 3 m, 1 to 9\n    Some number.\n"));
  const auto json = run_program("plugins describe writer/quiet --json" + plugins);
  const Value described = parse_yaml(json.out, "quiet.json");
  const Value& size = described.list.at(0).find("parameters")->list.at(0);
  CHECK(size.find("key")->scalar == "size");
  CHECK(size.find("min")->scalar == "1");
  CHECK(size.find("unit")->scalar == "m");
  const auto unknown = run_program("plugins describe shape");
  CHECK(unknown.code == 4);
  CHECK(has(unknown.err, "no component is called 'shape'; did you mean 'shapes'?"));
}

TEST_CASE("a job that names a broken component ends with code 4", "[cli]") {
  const WorkFolder folder;
  const auto job = folder.write(
      "job.yaml",
      "total_captures: 1\nenvironments: [{type: shapes}]\ncameras: [{type: pinhole}]\n"
      "physics: {type: none}\nrenderer: {type: 'null'}\nwriters: [{type: throws_in_factory}]\n"
      "output: {folder: " +
          (folder.path / "out").string() + "}\n");
  const auto run =
      run_program("--log-level error --plugin-dir " DIORAMA_FAULTY_PLUGINS " run " + job.string());
  INFO(run.err);
  CHECK(run.code == 4);
  CHECK(has(run.err, "writer 'throws_in_factory': unexpected error: out of pencils"));
  CHECK_FALSE(std::filesystem::exists(folder.path / "out"));
}

TEST_CASE("plugins check tries one plugin and says what failed", "[cli]") {
  const auto good = run_program("plugins check " DIORAMA_FAULTY_PLUGINS "/well_behaved.so");
  INFO(good.out);
  CHECK(good.code == 0);
  CHECK(has(good.out, "passed  writer/quiet: unknown keys are refused\n"));
  CHECK(has(good.out, " checks, 0 failed, 0 skipped\n"));
  const auto bad =
      run_program("plugins check --json " DIORAMA_FAULTY_PLUGINS "/faulty_components.so");
  CHECK(bad.code == 4);
  const Value list = parse_yaml(bad.out, "check.json");
  std::set<std::string> failed;
  for (const Value& result : list.list) {
    if (result.find("outcome")->scalar == "failed") failed.insert(result.find("subject")->scalar);
  }
  CHECK(failed == std::set<std::string>{"writer/not_a_writer", "writer/refuses_in_factory",
                                        "writer/returns_null", "writer/throws_in_call",
                                        "writer/throws_in_factory", "writer/throws_number"});
  const auto other = run_program("plugins check " DIORAMA_SOURCE_DIR "/LICENSE");
  CHECK(other.code == 4);
  CHECK(other.out.starts_with("failed  LICENSE: the descriptor fits this program: "));
  CHECK(run_program("plugins check").code == 2);
}

TEST_CASE("the doctor names what is missing and how to get it", "[cli]") {
  const auto run = run_program("doctor --plugin-dir /nowhere");
  CHECK(run.code == 4);
  CHECK(has(run.out, "program\n  version "));
  CHECK(has(run.out, "  plugin ABI " DIORAMA_DETAIL_TEXT(DIORAMA_SDK_ABI) "\n"));
  CHECK(has(run.out, " GiB of it available\n"));
  CHECK(has(run.out, "  ! /nowhere: given by --plugin-dir, but it is no folder\n"));
  CHECK(has(run.out, "renderers\n"));
  CHECK(has(run.out, "  null starts\n"));
  const auto assets = run_program("doctor --assets-root /nowhere");
  CHECK(assets.code == 4);
  CHECK(
      has(assets.out, "  ! /nowhere: the assets root (--assets-root) is no folder that exists\n"));
}
