// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

constexpr const char* kBenchBox = R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World"
{
    def Cube "Box"
    {
        double size = 1
    }
    def SphereLight "Lamp"
    {
        float inputs:radius = 0.2
        float inputs:intensity = 1000
        double3 xformOp:translate = (2, -2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
)";

constexpr const char* kRig = R"({
  "camera": {"width": 32, "height": 24, "fx": 30, "fy": 30, "cx": 16, "cy": 12,
             "cam2world_blender": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4]]},
  "lights": [{"position_blender": [1, 1, 3], "radius": 0.1, "power_watt": 100,
              "color": [1, 1, 1]}]})";

Outcome bench(const TemporaryFolder& folder, std::vector<std::string> more) {
  write_file(folder / "box.usda", kBenchBox);
  write_file(folder / "rig.json", kRig);
  std::vector<std::string> all{"bench", "--scene", "box.usda"};
  all.insert(all.end(), more.begin(), more.end());
  return run(all, folder.path());
}

}  // namespace

TEST_CASE("bench tells speed, error and where the time goes", "[bench]") {
  const TemporaryFolder folder;
  const Outcome outcome =
      bench(folder, {"--width", "48", "--height", "32", "--set", "samples=8", "--set",
                     "denoise=true", "--reference-samples", "256", "--repetitions", "2", "--json"});
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const auto json = nlohmann::json::parse(outcome.output);
  CHECK(json["width"] == 48);
  CHECK(json["prepare_phases_s"].contains("ray tracing structure"));
  CHECK(json["prepare_phases_s"].contains("light tables"));
  REQUIRE(json["runs"].size() == 2);
  for (const auto& run : json["runs"]) {
    CHECK(run["paths"] == 48 * 32 * (8 + 1));  // two to learn from: see RadianceCache
    CHECK(run["rays"] >= run["paths"]);
    CHECK(run["paths_per_s"] > 0.0);
    CHECK(run["render_phases_s"].contains("denoising"));
    CHECK(run["rel_mse"] > 0.0);
    CHECK(run["rel_mse"] < 0.1);
    CHECK(std::abs(run["bias"].get<double>()) < 0.05);
  }
  // Another pattern of noise each time.
  CHECK(json["runs"][0]["rel_mse"] != json["runs"][1]["rel_mse"]);
}

TEST_CASE("bench compares with a given picture, under lights of a file", "[bench]") {
  const TemporaryFolder folder;
  const std::vector<std::string> common{"--lights",      "rig.json", "--diffuse", "--set",
                                        "denoise=false", "--set",    "samples=16"};
  auto first = common;
  first.insert(first.end(), {"-o", "reference.exr"});
  REQUIRE(bench(folder, first).exit_code == 0);
  auto second = common;
  second.insert(second.end(), {"--reference", "reference.exr"});
  const Outcome same = bench(folder, second);
  INFO(same.errors);
  REQUIRE(same.exit_code == 0);
  CHECK_THAT(same.output, ContainsSubstring("box.usda, 32x24, embree, 1 picture"));
  CHECK_THAT(same.output, ContainsSubstring("RMSE 0, relMSE 0"));
  CHECK_THAT(same.output, ContainsSubstring("rays per path"));
  second.insert(second.end(), {"--width", "16"});
  const Outcome other = bench(folder, second);
  CHECK(other.exit_code == 5);
  CHECK_THAT(other.errors,
             ContainsSubstring("reference.exr: expected 16 x 12 pixels, found 32 x 24"));
}

TEST_CASE("a renderer that counts nothing can be timed", "[bench]") {
  const TemporaryFolder folder;
  const Outcome outcome = bench(folder, {"--renderer", "null", "--width", "16"});
  CHECK(outcome.exit_code == 0);
  CHECK_THAT(outcome.output, !ContainsSubstring("paths/s"));
}
