// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/plugin_search.h"

#include <cstdlib>
#include <map>

#include "framework/host/host_services.h"
#include "framework/plugins/registry.h"
#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

const std::string kAbi = "plugins-" DIORAMA_DETAIL_TEXT(DIORAMA_SDK_ABI);

std::vector<std::string> level_texts(const std::map<std::string, std::string>& environment,
                                     const std::vector<fs::path>& command_line) {
  const Environment lookup = [&](const char* name) -> const char* {
    const auto found = environment.find(name);
    return found == environment.end() ? nullptr : found->second.c_str();
  };
  std::vector<std::string> texts;
  for (const SearchLevel& level : plugin_search_levels(command_line, lookup, "/bundled")) {
    std::string text = level.name + (level.must_exist ? "!" : "");
    for (const fs::path& folder : level.folders) text += " " + folder.string();
    texts.push_back(text);
  }
  return texts;
}

void ignore(LogLevel, std::string_view) {}

/// Reads ".ball" files and "ball:" assets; keeps count of its work.
class BallLoader final : public Loader {
 public:
  struct Params {
    double radius = 0.5;
    void visit(ParamVisitor& v) { v.param("radius", radius, {"Of the ball.", "m", 0.0, 9.0}); }
  };
  BallLoader(const Params& params, Host&) : radius_(params.radius) {}
  std::vector<std::string> claims() const override { return {".ball", "ball:"}; }
  void load(std::string_view, Scene& scene, NodeId root) override {
    scene.edit(root).mesh = std::make_shared<Mesh>(make_sphere(radius_));
  }

 private:
  double radius_;
};

void register_ball(Registrar& registrar) {
  diorama::add<BallLoader>(registrar, "ball", "Loads balls.");
}

Value job_entry(std::string_view type) {
  Value map = Value::make_map();
  map.place = {"job.yaml", 4, 11};
  map.set("type", Value::text(type)).place = {"job.yaml", 5, 9};
  return map;
}

}  // namespace

TEST_CASE("plugins are searched in four places, in order", "[plugins]") {
  CHECK(level_texts({}, {}) == std::vector<std::string>{"--plugin-dir!", "bundled /bundled"});
  CHECK(level_texts({{"HOME", "/home/u"}, {"DIORAMA_PLUGIN_PATH", "/p:rel::/q"}}, {"/a", "/b"}) ==
        std::vector<std::string>{"--plugin-dir! /a /b", "DIORAMA_PLUGIN_PATH! /p rel /q",
                                 "the home folder /home/u/.local/share/diorama/" + kAbi + " " +
                                     bundled_plugin_folder("/home/u/.local/bin/diorama").string(),
                                 "bundled /bundled"});
  CHECK(level_texts({{"HOME", "/home/u"}, {"XDG_DATA_HOME", "/data"}}, {})[1] ==
        "XDG_DATA_HOME /data/diorama/" + kAbi);
  // Relative paths in it are to be ignored.
  CHECK(level_texts({{"HOME", "/home/u"}, {"XDG_DATA_HOME", "data"}}, {})[1] ==
        "the home folder /home/u/.local/share/diorama/" + kAbi + " " +
            bundled_plugin_folder("/home/u/.local/bin/diorama").string());
}

TEST_CASE("plugins that CMake installs by itself are found", "[plugins]") {
  const fs::path local = *local_plugin_folder("/opt/diorama/bin/diorama");
  CHECK(local == bundled_plugin_folder("/usr/local/bin/diorama"));
  CHECK(local.string().starts_with("/usr/local/lib"));
  const Environment nothing = [](const char*) { return nullptr; };
  const auto levels = plugin_search_levels({}, nothing, "/bundled", local);
  REQUIRE(levels.size() == 3);
  CHECK(levels[1].folders == std::vector<fs::path>{local});
  CHECK_FALSE(levels[1].must_exist);
  // The program that is installed there has one level for both.
  CHECK(plugin_search_levels({}, nothing, local, local).size() == 2);
  // What a developer has installed shows in no build tree.
  CHECK_FALSE(local_plugin_folder(DIORAMA_BINARY_DIR "/bin/diorama"));
}

TEST_CASE("a named folder that is not there is reported, a usual one is not", "[plugins]") {
  const PluginSearch search = search_plugins(
      {{"--plugin-dir", {"/nowhere"}, true}, {"bundled", {"/nowhere2"}, false}}, false);
  CHECK(search.plugins.empty());
  REQUIRE(search.rejected.size() == 1);
  CHECK(search.rejected[0].reason == "/nowhere: given by --plugin-dir, but it is no folder");
}

TEST_CASE("an empty registry is a valid one", "[plugins]") {
  Registry registry({}, ignore);
  CHECK(registry.components().empty());
  CHECK_THROWS_WITH(registry.entry(ComponentKind::Writer, "x"),
                    "no writer 'x': no writer plugin was found; 'diorama plugins' shows where was "
                    "looked");
  HostServices host(registry, {}, ignore);
  Scene scene;
  CHECK_THROWS_WITH(host.load_asset(DIORAMA_SOURCE_DIR "/LICENSE", scene, scene.root()),
                    DIORAMA_SOURCE_DIR
                    "/LICENSE: no loader reads a file without an ending that begins like this; "
                    "there are loaders for: nothing");
}

TEST_CASE("making components complains about everything that a job got wrong", "[plugins]") {
  Registry registry({}, ignore);
  registry.add_builtin(register_ball, "1.0.0");
  HostServices host(registry, {}, ignore);
  Diagnostics diagnostics;
  const auto make = [&](const Value& map) {
    return registry.make<Loader>(map, "environments[0]", {}, diagnostics, host);
  };
  CHECK_FALSE(make(job_entry("bal")));
  Value without = Value::make_map();
  without.place = {"job.yaml", 7, 3};
  CHECK_FALSE(make(without));
  Value text = Value::text("ball");
  text.place = {"job.yaml", 8, 3};
  CHECK_FALSE(make(text));
  Value extra = job_entry("ball");
  extra.set("radios", Value::number(2)).key_place = {"job.yaml", 9, 3};
  CHECK_FALSE(make(extra));
  CHECK_FALSE(make(job_entry("submarine")));
  REQUIRE(diagnostics.messages().size() == 5);
  CHECK(diagnostics.messages()[4] ==
        "job.yaml:5:9: environments[0]: unknown loader 'submarine'. There is: ball");
  CHECK(diagnostics.messages()[0] ==
        "job.yaml:5:9: environments[0]: unknown loader 'bal', did you mean 'ball'? There is: ball");
  CHECK(diagnostics.messages()[1] ==
        "job.yaml:7:3: environments[0]: expected the key 'type' with one of: ball");
  CHECK(
      diagnostics.messages()[2] ==
      "job.yaml:8:3: environments[0]: expected a mapping that names a loader with the key 'type', "
      "found the text 'ball'");
  CHECK(diagnostics.messages()[3].starts_with("job.yaml:9:3: "));
  CHECK(diagnostics.messages()[3].find("radius") != std::string::npos);
  const Value good = job_entry("ball");
  CHECK(make(good));
  CHECK(diagnostics.messages().size() == 5);
}

TEST_CASE("the bundled plugins are found from the program's place", "[plugins]") {
  CHECK(bundled_plugin_folder(DIORAMA_PROGRAM) == DIORAMA_PLUGIN_DIR);
  const fs::path installed = bundled_plugin_folder("/opt/tool/bin/diorama");
  CHECK(installed.string().starts_with("/opt/tool/lib"));
  CHECK(installed.string().ends_with("/diorama/" + kAbi));
  CHECK(sample_pack_folder("/opt/tool/bin/diorama") == "/opt/tool/share/diorama/assets");
}
