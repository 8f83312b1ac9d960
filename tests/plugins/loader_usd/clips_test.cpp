// SPDX-License-Identifier: Apache-2.0
#include <string>

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
  const std::string file = folder.write("root.usda", with_clips("", kTwo));
  const auto at = [&](double time) {
    Stage stage(file, Sampling::OrFirstSample, Stage::kComposedBytes, {}, {}, time / 24.0);
    return x_of(stage, "/Model/Child");
  };
  CHECK(at(2.5) == Approx(5.5));
  CHECK(at(11) == Approx(10.0));  // clip time 102
  // Behind its last sample a clip leads to where the next one begins: 6 at 4, 12 at 10.
  CHECK(at(7) == Approx(9.0));
  CHECK(at(9.5) == Approx(11.5));
  CHECK(at(10) == Approx(12.0));
  CHECK(at(0) == Approx(5.0));
  CHECK(at(1000) == Approx(8.0 + 8.0 / 97.0));

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
  const auto cached = [&](double time) {
    Stage stage(cache, Sampling::OrFirstSample, Stage::kComposedBytes, {}, {}, time / 24.0);
    return x_of(stage, "/Model/Child");
  };
  CHECK(cached(1.25) == Approx(12.5));
  CHECK(cached(3) == Approx(40.0));
  CHECK(cached(5) == Approx(60.0));
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
