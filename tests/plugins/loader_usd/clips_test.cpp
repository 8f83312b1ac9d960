// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "plugins/loader_usd/loaded_stage.h"
#include "plugins/loader_usd/stage_files.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::usd {
namespace {

using diorama::test::TemporaryFolder;

std::string samples(const std::string& list) {
  return "#usda 1.0\nover \"Anim\"\n{\n    over \"Child\"\n    {\n        double x.timeSamples = "
         "{ " +
         list + " }\n    }\n}\n";
}

std::string with_clips(const std::string& head, const std::string& clips,
                       const std::string& child = "double x") {
  return "#usda 1.0\n(\n" + head +
         ")\ndef \"Model\" (\n    clips = {\n        dictionary default = {\n" + clips +
         "        }\n    }\n)\n{\n    def \"Child\"\n    {\n        " + child + "\n    }\n}\n";
}

double x_of_child(const std::string& file, const char* path = "/Model/Child") {
  Stage stage(file, Sampling::OrFirstSample);
  return x_of(stage, path);
}

Stage stage_at(const std::string& file, double time) {
  return Stage(file, Sampling::OrFirstSample, Stage::kComposedBytes, {}, {}, time / 24.0);
}

/// The value at a time, -1 where there is none.
double value_at(const std::string& file, double time, const char* path,
                const char* attribute = "x") {
  Stage stage = stage_at(file, time);
  return x_of(stage, path, attribute);
}

const std::string kTwo = R"(            asset[] assetPaths = [@./one.usda@, @./two.usda@]
            string primPath = "/Anim"
            double2[] active = [(1, 0), (10, 1)]
            double2[] times = [(1, 1), (10, 10), (10, 101), (20, 111)]
)";

}  // namespace

TEST_CASE("values of clips are those of the stage's start", "[clips]") {
  const TemporaryFolder folder;
  folder.write("one.usda", samples("1: 5, 4: 6"));
  folder.write("two.usda", samples("100: 7, 103: 8, 200: 9"));
  const auto at = [&](const std::string& head) {
    return x_of_child(folder.write("root.usda", with_clips(head, kTwo)));
  };
  CHECK(at("") == 5.0);
  CHECK(at("    startTimeCode = 4\n") == 6.0);
  // At the same time the later mapping counts.
  CHECK(at("    startTimeCode = 10\n") == Approx(7.0 + 1.0 / 3.0));
  CHECK(at("    startTimeCode = 12\n") == 8.0);
  CHECK(at("    startTimeCode = -3\n") == 5.0);
}

TEST_CASE("values run straight from sample to sample, and on to the next clip", "[clips]") {
  const TemporaryFolder folder;
  folder.write("one.usda", samples("1: 5, 4: 6"));
  folder.write("two.usda", samples("101: 12, 103: 8, 200: 9"));
  const auto at = [&](const std::string& clips, double time) {
    return value_at(folder.write("root.usda", with_clips("", clips)), time, "/Model/Child");
  };
  CHECK(at(kTwo, 2.5) == Approx(5.5));
  CHECK(at(kTwo, 11) == Approx(10.0));  // clip time 102
  CHECK(at(kTwo, 0) == Approx(5.0));
  CHECK(at(kTwo, 10) == Approx(12.0));
  CHECK(at(kTwo, 1000) == Approx(8.0 + 8.0 / 97.0));
  // Time jumps at 10, so that the first clip holds its last value until then.
  CHECK(at(kTwo, 7) == Approx(6.0));
  CHECK(at(kTwo, 9.5) == Approx(6.0));
  // Without a jump a clip leads from its last sample to where the next one begins: 6 at 4, 12
  // at 10.
  std::string steady = kTwo;
  const std::string jump = "(10, 10), (10, 101), (20, 111)";
  steady.replace(steady.find(jump), jump.size(), "(200, 200)");
  folder.write("two.usda", samples("10: 12, 103: 8, 200: 9"));
  CHECK(at(steady, 7) == Approx(9.0));
  CHECK(at(steady, 9.5) == Approx(11.5));
  CHECK(at(steady, 10) == Approx(12.0));

  // One file per frame, as caches of geometry have it.
  folder.write("clip.1.usda", samples("1: 10"));
  folder.write("clip.2.usda", samples("2: 20"));
  folder.write("clip.4.usda", samples("4: 60"));
  const std::string cache = folder.write("cache.usda", with_clips("", R"(
            string templateAssetPath = "./clip.#.usda"
            double templateStartTime = 1
            double templateEndTime = 4
            double templateStride = 1
            string primPath = "/Anim"
)"));
  const auto cached = [&](double time) { return value_at(cache, time, "/Model/Child"); };
  CHECK(cached(1.25) == Approx(12.5));
  CHECK(cached(3) == Approx(40.0));
  CHECK(cached(5) == Approx(60.0));
}

TEST_CASE("clips of several frames per file run until the last file's own time", "[clips]") {
  const TemporaryFolder folder;
  folder.write("clip.10.usda", samples("10: 1, 19: 10"));
  folder.write("clip.20.usda", samples("15: 40, 20: 20, 29: 29"));
  const auto at = [&](double time, const std::string& more = "") {
    const std::string file = folder.write("cache.usda", with_clips("", R"(
            string templateAssetPath = "./clip.#.usda"
            double templateStartTime = 10
            double templateEndTime = 20
            double templateStride = 10
            string primPath = "/Anim"
)" + more));
    return value_at(file, time, "/Model/Child");
  };
  CHECK(at(14.5) == Approx(5.5));
  CHECK(at(19.5) == Approx(15.0));
  // OpenUSD maps each file's time to itself and keeps the last.
  CHECK(at(25) == Approx(20.0));
  // Files come earlier or later by an offset, and time goes on for as much.
  const std::string earlier = "            double templateActiveOffset = -5\n";
  CHECK(at(16, earlier) == Approx(36.0));
  CHECK(at(24, earlier) == Approx(24.0));
  CHECK(at(40, earlier) == Approx(25.0));
}

namespace {

/// As OpenUSD's own test has it (testUsdValueClips, missingValueInterpolation): four clips, each of
/// two frames, that lack one attribute or another.
class GappyClips {
 public:
  GappyClips() {
    clip("clip1", {{"notInMiddle", "0: 100, 1: 200"}, {"notInLast", "0: 100, 1: 200"}});
    clip("clip2", {{"notInFirst", "2: 300, 3: 400"}, {"notInLast", "2: 300, 3: 400"}});
    clip("clip3", {{"notInFirst", "4: 500, 5: 600"}, {"notInLast", "4: 500, 5: 600"}});
    clip("clip4", {{"notInFirst", "6: 700, 7: 800"}, {"notInMiddle", "6: 700, 7: 800"}});
    manifest("plain", [](const char* name) { return std::string(name); });
    manifest("fallbacks", [](const char* name) { return std::string(name) + " = 42"; });
  }
  void clip(const std::string& name, const std::map<std::string, std::string>& attributes) {
    std::string text = "#usda 1.0\ndef \"Clip\"\n{\n";
    for (const auto& [attribute, list] : attributes) {
      text += "    double " + attribute + ".timeSamples = { " + list + " }\n";
    }
    folder_.write(name + ".usda", text + "}\n");
  }
  void manifest(const std::string& name,
                const std::function<std::string(const char* attribute)>& said) {
    std::string text = "#usda 1.0\ndef \"Clip\"\n{\n";
    for (const char* attribute : {"notInFirst", "notInMiddle", "notInLast", "notInAny"}) {
      text += "    double " + said(attribute) + "\n";
    }
    folder_.write(name + ".usda", text + "}\n");
  }
  double at(double time, const char* attribute, const std::string& manifest,
            bool bridges = true) const {
    const std::string named =
        manifest.empty() ? "" : "            asset manifestAssetPath = @./" + manifest + ".usda@\n";
    const std::string file = folder_.write("root.usda", R"(#usda 1.0
def "Ref"
{
    double notInFirst = -7
    double notInMiddle = -7
    double notInLast = -7
    double notInAny = -7
    double undeclared = -7
}
def "Model" (
    references = </Ref>
    clips = {
        dictionary default = {
            asset[] assetPaths = [@./clip1.usda@, @./clip2.usda@, @./clip3.usda@, @./clip4.usda@]
            string primPath = "/Clip"
            double2[] active = [(0, 0), (2, 1), (4, 2), (6, 3)]
            double2[] times = [(0, 0), (7, 7)]
            bool interpolateMissingClipValues = )" + std::string(bridges ? "true" : "false") +
                                                            "\n" + named +
                                                            "        }\n    }\n)\n{\n}\n");
    return value_at(file, time, "/Model", attribute);
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace

TEST_CASE("values run over clips that say nothing, as in OpenUSD", "[clips]") {
  GappyClips clips;
  clips.manifest("blocks", [](const char* attribute) {
    const std::string name = attribute;
    const std::string list = name == "notInFirst"    ? "0: None"
                             : name == "notInMiddle" ? "2: None, 4: None"
                             : name == "notInLast"   ? "6: None"
                                                     : "0: None, 2: None, 4: None, 6: None";
    return name + ".timeSamples = { " + list + " }";
  });
  const std::string manifest = GENERATE("", "plain", "blocks");
  CAPTURE(manifest);
  // Held before the first of them and behind the last, straight between.
  for (double time = -1.0; time <= 8.0; time += 0.5) {
    CAPTURE(time);
    const double straight = 100.0 + 100.0 * time;
    CHECK(clips.at(time, "notInFirst", manifest) == Approx(std::clamp(straight, 300.0, 800.0)));
    CHECK(clips.at(time, "notInMiddle", manifest) == Approx(std::clamp(straight, 100.0, 800.0)));
    CHECK(clips.at(time, "notInLast", manifest) == Approx(std::clamp(straight, 100.0, 600.0)));
  }
  // What a manifest declares is the clips' alone, even if none has it.
  CHECK(clips.at(1, "notInAny", manifest) == (manifest.empty() ? -7.0 : -1.0));
  CHECK(clips.at(1, "undeclared", manifest) == -7.0);
}

TEST_CASE("a manifest's defaults stand in for what clips leave out, as in OpenUSD", "[clips]") {
  const GappyClips clips;
  const auto check = [&](const char* attribute,
                         const std::vector<std::pair<double, double>>& expected) {
    for (const auto& [time, value] : expected) {
      CAPTURE(attribute, time);
      CHECK(clips.at(time, attribute, "fallbacks") == Approx(value));
    }
  };
  check("notInFirst",
        {{-1, 42}, {-0.5, 42}, {0, 42}, {0.5, 106.5}, {1, 171}, {1.5, 235.5}, {2, 300}});
  check("notInMiddle", {{1, 200},
                        {1.5, 121},
                        {2, 42},
                        {2.5, 42},
                        {4, 42},
                        {4.5, 206.5},
                        {5, 371},
                        {5.5, 535.5},
                        {6, 700}});
  check("notInLast", {{5, 600}, {5.5, 321}, {6, 42}, {7, 42}, {8, 42}});
  check("notInAny", {{-1, 42}, {0, 42}, {1, 42}});
}

TEST_CASE("without bridges a clip that says nothing has no value", "[clips]") {
  const GappyClips clips;
  CHECK(clips.at(1, "notInLast", "plain", false) == Approx(200.0));
  CHECK(clips.at(7, "notInLast", "plain", false) == -1.0);
  CHECK(clips.at(7, "notInLast", "fallbacks", false) == 42.0);
  CHECK(clips.at(3, "notInMiddle", "plain", false) == -1.0);
  // Who has no manifest says nothing of what the active clip lacks.
  CHECK(clips.at(3, "notInMiddle", "", false) == -7.0);
}

TEST_CASE("a block as a manifest's default is no value, and jumps keep clips apart", "[clips]") {
  // As OpenUSD's own test has it (testUsdValueClips, manifestFallback).
  const TemporaryFolder folder;
  const auto write = [&](const char* name, const std::string& list) {
    folder.write(name, "#usda 1.0\ndef \"Model\"\n{\n    double a.timeSamples = { " + list +
                           " }\n    double b.timeSamples = { " + list + " }\n}\n");
  };
  write("clip1.usda", "0: 10, 1: 12, 2: 14");
  write("clip2.usda", "0: 20, 1: 22, 2: 24");
  folder.write("none.usda", "#usda 1.0\ndef \"Model\"\n{\n}\n");
  folder.write("manifest.usda",
               "#usda 1.0\nover \"Model\"\n{\n    double a = 50\n    double b = None\n}\n");
  const std::string file = folder.write("root.usda", R"(#usda 1.0
def "Model" (
    clips = {
        dictionary default = {
            asset[] assetPaths = [@./clip1.usda@, @./none.usda@, @./clip2.usda@]
            asset manifestAssetPath = @./manifest.usda@
            string primPath = "/Model"
            double2[] active = [(0, 0), (2, 1), (4, 2)]
            double2[] times = [(0, 0), (2, 2), (2, 0), (4, 2), (4, 0)]
        }
    }
)
{
}
)");
  for (const auto& [time, a, b] : std::vector<std::array<double, 3>>{
           {0, 10, 10}, {1.5, 13, 13}, {2, 50, -1}, {3.9, 50, -1}, {4, 20, 20}}) {
    CAPTURE(time);
    CHECK(value_at(file, time, "/Model", "a") == Approx(a));
    CHECK(value_at(file, time, "/Model", "b") == Approx(b));
  }
}

TEST_CASE("clip sets are asked by name, or as clipSets lists them", "[clips]") {
  const TemporaryFolder folder;
  folder.write("one.usda", samples("0: 1"));
  folder.write("two.usda", samples("0: 2"));
  const auto with = [&](const std::string& order) {
    const auto set = [](const std::string& name, const std::string& file) {
      return "        dictionary " + name + " = {\n            asset[] assetPaths = [@./" + file +
             "@]\n            string primPath = \"/Anim\"\n"
             "            double2[] active = [(0, 0)]\n        }\n";
    };
    const std::string file = folder.write(
        "root.usda", "#usda 1.0\ndef \"Model\" (\n    clips = {\n" + set("b", "two.usda") +
                         set("a", "one.usda") + "    }\n" + order +
                         ")\n{\n    def \"Child\"\n    {\n        double x\n    }\n}\n");
    return value_at(file, 0, "/Model/Child");
  };
  CHECK(with("") == 1.0);
  CHECK(with("    clipSets = [\"b\", \"a\"]\n") == 2.0);
  CHECK(with("    prepend clipSets = [\"b\"]\n") == 2.0);
  CHECK(with("    delete clipSets = [\"a\"]\n") == 2.0);
  CHECK(with("    clipSets = [\"none\"]\n") == -1.0);
}

TEST_CASE("clips are stronger than what is referenced beside them", "[clips]") {
  const TemporaryFolder folder;
  folder.write("one.usda", samples("1: 5, 4: 6"));
  folder.write("two.usda", samples("100: 7"));
  folder.write("model.usda", R"(#usda 1.0
def "Model"
{
    def "Child"
    {
        double x = 3
        double y = 4
    }
}
)");
  // As caches are laid over a model that stands at rest.
  std::string text = with_clips("", kTwo, "double z = 8");
  text.replace(text.find("def \"Model\" ("), 13,
               "def \"Model\" (\n    references = @model.usda@</Model>");
  const std::string file = folder.write("root.usda", text);
  Stage stage(file, Sampling::OrFirstSample, Stage::kComposedBytes, {}, {}, 1.0 / 24.0);
  CHECK(x_of(stage, "/Model/Child") == 5.0);
  CHECK(x_of(stage, "/Model/Child", "y") == 4.0);
  CHECK(x_of(stage, "/Model/Child", "z") == 8.0);
  // What stands beside them is stronger.
  std::string said = text;
  said.replace(said.find("double z = 8"), 12, "double x = 9");
  Stage beside(folder.write("root.usda", said), Sampling::OrFirstSample, Stage::kComposedBytes, {},
               {}, 1.0 / 24.0);
  CHECK(x_of(beside, "/Model/Child") == 9.0);
  // A child that the file with the clips does not mention.
  std::string silent = text;
  const std::size_t from = silent.find("    def \"Child\"");
  silent.replace(from, silent.rfind('}') - from, "");
  Stage unmentioned(folder.write("root.usda", silent), Sampling::OrFirstSample,
                    Stage::kComposedBytes, {}, {}, 1.0 / 24.0);
  CHECK(x_of(unmentioned, "/Model/Child") == 5.0);
}

TEST_CASE("clips are weaker than what the layers say at the default time", "[clips]") {
  const TemporaryFolder folder;
  folder.write("one.usda", samples("1: 5"));
  folder.write("two.usda", samples("100: 7"));
  const auto with = [&](const char* child) {
    return x_of_child(folder.write("root.usda", with_clips("", kTwo, child)));
  };
  CHECK(with("double x = 3") == 3.0);
  CHECK(with("double x.timeSamples = { 2: 4 }") == 4.0);
  CHECK(with("double x = None") == 5.0);
  // The default time knows no clips.
  Stage stage(folder.write("root.usda", with_clips("", kTwo)));
  CHECK(x_of(stage, "/Model/Child") == -1.0);
}

TEST_CASE("templates of clips are filled in with what is there", "[clips]") {
  const TemporaryFolder folder;
  folder.write("clip.002.usda", samples("2: 12"));
  folder.write("clip.004.usda", samples("4: 14"));
  const std::string clips = R"(            string templateAssetPath = "./clip.###.usda"
            double templateStartTime = 1
            double templateEndTime = 5
            double templateStride = 1
            string primPath = "/Anim"
)";
  const auto at = [&](const std::string& head) {
    return x_of_child(folder.write("root.usda", with_clips(head, clips)));
  };
  CHECK(at("") == 12.0);
  CHECK(at("    startTimeCode = 3\n") == 13.0);
  CHECK(at("    startTimeCode = 4\n") == 14.0);
  CHECK(at("    startTimeCode = 400\n") == 14.0);
}

TEST_CASE("clips of a referenced file are relative to it, and moved with it", "[clips]") {
  const TemporaryFolder folder;
  folder.write("parts/one.usda", samples("1: 5, 4: 6"));
  folder.write("parts/two.usda", samples("100: 7"));
  folder.write("parts/model.usda", with_clips("", kTwo));
  const std::string file = folder.write("root.usda", R"(#usda 1.0
(
    startTimeCode = 24
)
def "A" (
    references = @parts/model.usda@</Model> (offset = 20)
)
{
}
def "B" (
    references = @parts/model.usda@</Model>
)
{
}
)");
  CHECK(x_of_child(file, "/A/Child") == 6.0);
  CHECK(x_of_child(file, "/B/Child") == 7.0);
}

TEST_CASE("meshes of two times of one clip are two meshes", "[clips]") {
  const TemporaryFolder folder;
  folder.write("clip.usda", R"(#usda 1.0
over "Anim"
{
    point3f[] points.timeSamples = {
        1: [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
        2: [(0, 0, 0), (3, 0, 0), (0, 1, 0)],
    }
}
)");
  const auto model = [](const std::string& name, const std::string& times) {
    return "def Mesh \"" + name +
           "\" (\n    clips = {\n        dictionary default = {\n"
           "            asset[] assetPaths = [@clip.usda@]\n            string primPath = "
           "\"/Anim\"\n"
           "            double2[] active = [(1, 0)]\n            double2[] times = " +
           times +
           "\n        }\n    }\n)\n{\n    int[] faceVertexCounts = [3]\n"
           "    int[] faceVertexIndices = [0, 1, 2]\n    point3f[] points\n}\n";
  };
  diorama::test::LoadedStage loaded(
      folder.write("root.usda", "#usda 1.0\n(\n    metersPerUnit = 1\n    startTimeCode = 1\n)\n" +
                                    model("M", "[(1, 1)]") + model("N", "[(1, 2)]")));
  CHECK(loaded.host.warnings.empty());
  CHECK(loaded.node("M").mesh->bounds().max.x() == 1.0);
  CHECK(loaded.node("N").mesh->bounds().max.x() == 3.0);
}

TEST_CASE("the files of an asset with clips are those of the clips, too", "[clips]") {
  const TemporaryFolder folder;
  for (const char* name : {"one.usda", "two.usda", "seen.usda", "frame.1.usda", "frame.3.usda"}) {
    folder.write(name, samples("1: 5"));
  }
  std::string text = with_clips("", kTwo + "            asset manifestAssetPath = @./seen.usda@\n");
  text += R"(def "Cached" (
    clips = {
        dictionary default = {
            string templateAssetPath = "./frame.#.usda"
            double templateStartTime = 1
            double templateEndTime = 4
            double templateStride = 1
            string primPath = "/Anim"
        }
    }
)
{
}
)";
  const std::string root = folder.write("root.usda", text);
  std::set<std::string> names;
  diorama::test::TextureHost host;
  for (const auto& file : loader_usd::UsdLoader({}, host).files(root))
    names.insert(file.filename());
  CHECK(names == std::set<std::string>{"root.usda", "one.usda", "two.usda", "seen.usda",
                                       "frame.1.usda", "frame.3.usda"});
}

TEST_CASE("clips that cannot be read are said", "[clips]") {
  const TemporaryFolder folder;
  const auto warning = [&](const std::string& clips) {
    Stage stage(folder.write("root.usda", with_clips("", clips)), Sampling::OrFirstSample);
    CHECK(x_of(stage, "/Model/Child") == -1.0);
    return stage.warnings().empty() ? std::string() : stage.warnings().front();
  };
  CHECK(warning(kTwo).find("value clip @./one.usda@ could not be found") != std::string::npos);
  CHECK(warning("            string primPath = \"/Anim\"\n").find("name no assets") !=
        std::string::npos);
  CHECK(
      warning("            string templateAssetPath = \"a.#.usda\"\n            string primPath = "
              "\"/Anim\"\n            double templateStartTime = 1\n            double "
              "templateEndTime = 1e9\n            double templateStride = 1\n")
          .find("lead to no file") != std::string::npos);
  folder.write("one.usda", "nonsense");
  CHECK(warning(kTwo).find("value clip @./one.usda@ could not be read") != std::string::npos);
}

}  // namespace diorama::usd
