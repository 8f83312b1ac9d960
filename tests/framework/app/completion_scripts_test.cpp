// SPDX-License-Identifier: Apache-2.0
#include "framework/app/completion_scripts.h"

#include <cstdlib>

#include "program_run.h"
#include "support/catch.h"

using namespace diorama;

namespace {

std::vector<CommandPage> commands() {
  OptionPage folder{"--dir DIR", "Where to.", {"--dir"}, "DIR"};
  OptionPage level{"--level LEVEL", "It's loud.", {"--level"}, "LEVEL"};
  OptionPage seed{"--seed N", "Start.", {"--seed"}, "N:INT in [0 - 9]"};
  OptionPage json{"--json", "For programs.", {"--json"}};
  OptionPage file{"FILE", "A plugin.", {}, "FILE", true};
  OptionPage kind{"KIND", "What.", {}, "KIND", true};
  return {{"diorama", "Fills rooms.", {folder, level}},
          {"diorama run", "Make the dataset", {seed, file}},
          {"diorama plugins", "List plugins", {json}},
          {"diorama plugins check", "Try one", {json, file}},
          {"diorama new-plugin", "Start one", {kind}}};
}

std::string script(const std::string& path) {
  for (const PageFile& file : completion_scripts(commands())) {
    if (file.path == path) return file.text;
  }
  return "no such file";
}

bool has_shell(const std::string& name) {
  if (std::system(("command -v " + name + " >/dev/null").c_str()) == 0) return true;
  WARN(name << " is not there; check skipped");
  return false;
}

/// What bash offers at the end of a command line whose last word may be empty.
std::string offered_by_bash(const std::string& line) {
  const test::WorkFolder folder;
  folder.write("model.so", "");
  const std::string path = folder.write("diorama.bash", script("completion/diorama.bash")).string();
  const auto run = test::run_shell("bash -c 'cd " + folder.path.string() + "; source " + path +
                                   "; COMP_WORDS=(" + line +
                                   "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _diorama; "
                                   "echo \"${COMPREPLY[*]}\"'");
  CHECK(run.err.empty());
  return run.out;
}

}  // namespace

TEST_CASE("bash offers commands, options and values", "[completion]") {
  CHECK(offered_by_bash("diorama \"\"") == "run plugins new-plugin\n");
  CHECK(offered_by_bash("diorama -") == "--dir --level\n");
  CHECK(offered_by_bash("diorama run --") == "--dir --level --seed\n");
  CHECK(offered_by_bash("diorama run --s") == "--seed\n");
  CHECK(offered_by_bash("diorama run mo") == "model.so\n");
  CHECK(offered_by_bash("diorama run --seed \"\"") == "\n");
  CHECK(offered_by_bash("diorama --level w") == "warning\n");
  CHECK(offered_by_bash("diorama run --level d") == "debug\n");
  CHECK(offered_by_bash("diorama plugins c") == "check\n");
  CHECK(offered_by_bash("diorama plugins check --j") == "--json\n");
  CHECK(offered_by_bash("diorama plugins check m") == "model.so\n");
  CHECK(offered_by_bash("diorama new-plugin w") == "writer\n");
  CHECK(offered_by_bash("diorama --dir somewhere new-plugin ran") == "randomizer\n");
}

TEST_CASE("zsh reads its script", "[completion]") {
  if (!has_shell("zsh")) return;
  const test::WorkFolder folder;
  const std::string path = folder.write("_diorama", script("completion/_diorama")).string();
  const auto run = test::run_shell("zsh -n " + path);
  CHECK(run.code == 0);
  CHECK(run.err.empty());
}

TEST_CASE("fish offers commands, options and values", "[completion]") {
  if (!has_shell("fish")) return;
  const test::WorkFolder folder;
  const std::string path = folder.write("diorama.fish", script("completion/diorama.fish")).string();
  const auto offered = [&](const std::string& line) {
    const auto run =
        test::run_shell("fish --no-config -c 'source " + path + "; complete -C \"" + line + "\"'");
    CHECK(run.err.empty());
    return run.out;
  };
  CHECK(offered("diorama r") == "run\tMake the dataset\n");
  CHECK(offered("diorama run --se") == "--seed\tStart.\n");
  CHECK(offered("diorama plugins --se") == "");
  CHECK(offered("diorama run --lev") == "--level\tIt's loud.\n");
  CHECK(offered("diorama --level w") == "warning\tIt's loud.\n");
  CHECK(offered("diorama plugins ch") == "check\tTry one\n");
  CHECK(offered("diorama new-plugin wri") == "writer\n");
}
