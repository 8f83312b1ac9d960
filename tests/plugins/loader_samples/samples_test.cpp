// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <string>

#include "loader_samples/samples_loader.h"
#include "loader_samples/sky.h"
#include "support/catch.h"
#include "support/mesh_checks.h"
#include "support/plain_host.h"

using namespace diorama;
using namespace diorama::samples;

namespace {

struct Loaded {
  explicit Loaded(const std::string& asset) {
    root = scene.create(scene.root(), "asset");
    SamplesLoader({}, host).load(asset, scene, root);
  }
  const Node& leaf() const { return scene[scene[root].children.at(0)]; }

  test::PlainHost host;
  Scene scene;
  NodeId root;
};

std::vector<std::string> list(const char* set) {
  test::PlainHost host;
  return SamplesLoader({.set = set}, host).assets();
}

}  // namespace

TEST_CASE("every object and prop is a sound, centred body of believable density",
          "[samples][slow]") {
  for (const char* set : {"objects", "props"}) {
    const std::vector<std::string> assets = list(set);
    CHECK(assets.size() >= 20);
    CHECK(std::is_sorted(assets.begin(), assets.end()));
    for (const std::string& asset : assets) {
      INFO(asset);
      const Loaded loaded(asset);
      const Node& leaf = loaded.leaf();
      REQUIRE(leaf.mesh);
      REQUIRE_NOTHROW(leaf.mesh->validate(asset));
      const test::MeshFaults faults = test::mesh_faults(*leaf.mesh);
      CHECK(faults.open_edges == 0);
      CHECK(faults.flipped == 0);
      CHECK(faults.degenerate == 0);
      const Aabb box = leaf.mesh->bounds();
      CHECK(box.centre().norm() < 1e-5);
      CHECK(box.size().maxCoeff() > 0.03);
      CHECK(box.size().maxCoeff() < 0.50);
      REQUIRE(loaded.scene[loaded.root].rigid_body);
      CHECK(leaf.collider);
      // Between foam and solid steel, within the box.
      const double density = loaded.scene[loaded.root].rigid_body->mass_kg / (box.size().prod());
      CHECK(density > 15);
      CHECK(density < 4000);
    }
  }
}

TEST_CASE("objects have the measures of the things they stand for", "[samples]") {
  // Width, depth and height in metres of the YCB set (Calli et al. 2015), in any order.
  const std::map<std::string, Vec3> sizes{{"003_cracker_box", {0.060, 0.158, 0.210}},
                                          {"005_tomato_soup_can", {0.066, 0.066, 0.101}},
                                          {"036_wood_block", {0.085, 0.085, 0.200}},
                                          {"061_foam_brick", {0.050, 0.050, 0.075}},
                                          {"056_tennis_ball", {0.0647, 0.0647, 0.0647}}};
  for (const auto& [name, expected] : sizes) {
    INFO(name);
    Vec3 size = Loaded("sample:" + name).leaf().mesh->bounds().size();
    std::sort(size.data(), size.data() + 3);
    CHECK((size - expected).cwiseAbs().maxCoeff() < 0.004);
  }
}

TEST_CASE("skies are finite, bright where the sun is, and differ", "[samples][slow]") {
  test::PlainHost host;
  std::map<std::string, double> mean;
  for (const SkyLook& look : skies()) {
    if (look.name != "Clear/qwantani_4k" && look.name != "Night/moonlit_golf_4k") continue;
    const auto image = make_sky(look, host);
    REQUIRE(image->width == 2 * image->height);
    REQUIRE(image->floats.size() == std::size_t(image->width) * std::size_t(image->height) * 3);
    std::size_t brightest = 0;
    double sum = 0;
    for (std::size_t i = 0; i < image->floats.size(); ++i) {
      REQUIRE(std::isfinite(image->floats[i]));
      REQUIRE(image->floats[i] >= 0);
      sum += double(image->floats[i]);
      if (image->floats[i] > image->floats[brightest]) brightest = i;
    }
    mean[std::string(look.name)] = sum / double(image->floats.size());
    const auto pixel = brightest / 3;
    const double row = double(pixel / std::size_t(image->width)) + 0.5;
    const double column = double(pixel % std::size_t(image->width)) + 0.5;
    // Row 0 looks up; the centre column is +x and the right half -y, so azimuth runs leftwards.
    CHECK(90 - 180 * row / image->height == Approx(look.sun_elevation_deg).margin(0.5));
    CHECK(180 - 360 * column / image->width == Approx(look.sun_azimuth_deg).margin(0.5));
  }
  CHECK(mean.size() == 2);
  CHECK(mean["Clear/qwantani_4k"] > 20 * mean["Night/moonlit_golf_4k"]);
  const Loaded sky("sky:Clear/qwantani_4k");
  REQUIRE(sky.scene[sky.root].light);
  CHECK(sky.scene[sky.root].light->kind == LightKind::Dome);
}

TEST_CASE("rooms seen from inside are lit by their lamps", "[samples]") {
  test::PlainHost host;
  std::map<double, std::string> by_mean;
  for (const SkyLook& look : skies()) {
    if (!look.is_indoor) continue;
    INFO(look.name);
    const auto image = make_sky(look, host);
    const auto size = std::size_t(image->width) * std::size_t(image->height) * 3;
    REQUIRE(image->floats.size() == size);
    double sum = 0;
    float lowest = image->floats[0];
    std::size_t brightest = 0;
    for (std::size_t i = 0; i < size; ++i) {
      REQUIRE(std::isfinite(image->floats[i]));
      lowest = std::min(lowest, image->floats[i]);
      sum += double(image->floats[i]);
      if (image->floats[i] > image->floats[brightest]) brightest = i;
    }
    CHECK(lowest > 0);
    CHECK(brightest < size / 2);
    CHECK(sum / double(size) > 0.02);
    CHECK(sum / double(size) < 1.0);
    by_mean.emplace(sum, look.name);
  }
  CHECK(by_mean.size() == 4);
}

TEST_CASE("names that do not exist get a suggestion", "[samples]") {
  CHECK_THROWS_WITH(
      Loaded("sample:011_bananas"),
      ContainsSubstring("sample:011_bananas: no such sample; did you mean '011_banana'?"));
  CHECK_THROWS_WITH(Loaded("prop:S_WetFloorSigns"), ContainsSubstring("'S_WetFloorSign'"));
  CHECK_THROWS_WITH(Loaded("sky:Mars"),
                    ContainsSubstring("there are: Cloudy/champagne_castle_1_4k"));
}

TEST_CASE("lists follow the chosen set", "[samples]") {
  CHECK(list("skies").size() == 13);
  CHECK(list("props")[0].starts_with("prop:"));
  CHECK(list("objects")[0] == "sample:002_master_chef_can");
}
