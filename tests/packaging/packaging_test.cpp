// SPDX-License-Identifier: Apache-2.0
// The Debian packages name the ABI, the version and the plugins that the sources have.
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "diorama/abi.h"
#include "framework/config/yaml_config.h"
#include "support/catch.h"

namespace fs = std::filesystem;

namespace {

const fs::path kRoot = DIORAMA_SOURCE_DIR;
const std::string kAbi = DIORAMA_DETAIL_TEXT(DIORAMA_SDK_ABI);

std::string read_text(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

std::string debian(const std::string& name) { return read_text(kRoot / "packaging/debian" / name); }

/// What the first group of the expression matches, each once.
std::set<std::string> all(const std::string& text, const std::string& expression) {
  const std::regex regex(expression);
  std::set<std::string> found;
  for (std::sregex_iterator it(text.begin(), text.end(), regex), end; it != end; ++it) {
    found.insert((*it)[1]);
  }
  return found;
}

/// "writer_*.so" names writer_coco.
bool names(const std::string& pattern, const std::string& plugin) {
  const std::size_t star = pattern.find('*');
  return star == pattern.npos ? pattern == plugin : plugin.starts_with(pattern.substr(0, star));
}

}  // namespace

TEST_CASE("packages carry the number of the plugin interface", "[packaging]") {
  const std::string control = debian("control");
  CHECK(all(control, "libdiorama-sdk(\\d+)") == std::set<std::string>{kAbi});
  CHECK(all(control, "diorama-plugin-abi-(\\d+)") == std::set<std::string>{kAbi});
  CHECK(all(debian("rules"), "libdiorama-sdk(\\d+)") == std::set<std::string>{kAbi});
  for (const char* library : {"libdiorama-sdk", "libdiorama"}) {
    CHECK(fs::exists(kRoot / "packaging/debian" / (library + kAbi + ".install")));
  }
  CHECK(all(control, "libdiorama(\\d+)") == std::set<std::string>{kAbi});
  CHECK(all(debian("rules"), "libdiorama(\\d+)") == std::set<std::string>{kAbi});
}

TEST_CASE("packages carry the version of the project", "[packaging]") {
  CHECK(debian("changelog").starts_with("diorama (" DIORAMA_VERSION "-"));
}

TEST_CASE("every package is installed from somewhere", "[packaging]") {
  for (const std::string& package : all(debian("control"), "\nPackage: (\\S+)")) {
    INFO(package);
    CHECK(fs::exists(kRoot / "packaging/debian" / (package + ".install")));
  }
}

TEST_CASE("every plugin is in one package", "[packaging]") {
  const std::string list = read_text(kRoot / "plugins/CMakeLists.txt");
  std::set<std::string> plugins = all(list, "\n  ([a-z]+_[a-z_0-9]+)(?=\n|\\))");
  std::erase_if(plugins, [](const std::string& name) { return name.ends_with("_support"); });
  CHECK(plugins.size() > 15);
  for (const std::string& plugin : plugins) {
    int packages = 0;
    for (const auto& entry : fs::directory_iterator(kRoot / "packaging/debian")) {
      if (entry.path().extension() != ".install") continue;
      for (const std::string& pattern : all(read_text(entry.path()), "plugins-\\*/(\\S+)\\.so")) {
        packages += names(pattern, plugin) ? 1 : 0;
      }
    }
    INFO(plugin);
    CHECK(packages == 1);
  }
}

TEST_CASE("templates for clusters say what their schedulers read", "[packaging]") {
  const auto read = [](const char* name) {
    return diorama::parse_yaml(read_text(kRoot / "packaging/cluster" / name), name);
  };
  const auto at = [](const diorama::Value& value, std::initializer_list<const char*> keys) {
    const diorama::Value* found = &value;
    for (const char* key : keys) {
      INFO(key);
      found = found->find(key);
      REQUIRE(found);
    }
    return *found;
  };
  const diorama::Value pods = read("kubernetes_job.yaml");
  CHECK(at(pods, {"kind"}).scalar == "Job");
  CHECK(at(pods, {"spec", "completionMode"}).scalar == "Indexed");
  const std::string shards = at(pods, {"spec", "completions"}).scalar;
  const diorama::Value containers = at(pods, {"spec", "template", "spec", "containers"});
  REQUIRE(containers.list.size() == 1);
  CHECK(at(containers.list[0], {"args"}).list[0].scalar.ends_with("+ 1))/" + shards + "\""));
  for (const diorama::Value& rule : at(pods, {"spec", "podFailurePolicy", "rules"}).list) {
    CHECK((rule.find("onPodConditions") || rule.find("onExitCodes")));
    if (!rule.find("onExitCodes")) continue;
    CHECK(at(rule, {"onExitCodes", "containerName"}).scalar ==
          at(containers.list[0], {"name"}).scalar);
  }

  const diorama::Value batch = read("aws_batch_job.yaml");
  CHECK(at(batch, {"type"}).scalar == "container");
  CHECK(at(batch, {"containerProperties", "command"}).list.size() == 3);
  const diorama::Value variable = at(batch, {"containerProperties", "environment"}).list[0];
  CHECK(at(variable, {"name"}).scalar == "SHARDS");
  // What the service takes of either.
  const int attempts = std::stoi(at(batch, {"retryStrategy", "attempts"}).scalar);
  CHECK((attempts >= 1 && attempts <= 10));
  CHECK(at(batch, {"retryStrategy", "evaluateOnExit"}).list.size() <= 5);
}

TEST_CASE("nobody needs what few use", "[packaging]") {
  // What is installed with the program, by need and by default.
  const std::string control = debian("control");
  const std::size_t program = control.find("\nPackage: diorama\n");
  REQUIRE(program != control.npos);
  const std::size_t suggested = control.find("\nSuggests:", program);
  const std::string wanted = control.substr(program, suggested - program);
  for (const std::string& package : all(wanted, "(diorama-plugins?-[a-z0-9]+) ?")) {
    if (!fs::exists(kRoot / "packaging/debian" / (package + ".install"))) continue;
    INFO(package);
    for (const char* heavy : {"placement_fcl", "writer_hdf5", "writer_video"}) {
      for (const std::string& pattern :
           all(debian(package + ".install"), "plugins-\\*/(\\S+)\\.so")) {
        CHECK_FALSE(names(pattern, heavy));
      }
    }
  }
}
