// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "dome_light.h"
#include "framework/pipeline/fake_host.h"
#include "random_colors.h"
#include "random_material.h"
#include "random_visibility.h"
#include "statistics.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

struct Props {
  Props() {
    const NodeId group = scene.create(scene.root(), "Distractors");
    auto red = std::make_shared<Material>();
    red->base_color = Vec3f(1, 0, 0);
    red->roughness = 0.33f;
    red->base_color_texture.texture = std::make_shared<Texture>();
    original = red;
    for (const char* name : {"cube", "cone"}) {
      nodes.push_back(scene.create(group, name));
      scene.edit(nodes.back()).mesh = mesh;
      scene.edit(nodes.back()).materials = {red, red};
    }
  }
  FakeHost host;
  Scene scene;
  std::shared_ptr<const Mesh> mesh = std::make_shared<const Mesh>(make_box(Vec3(1, 2, 3)));
  std::shared_ptr<const Material> original;
  std::vector<NodeId> nodes;
};

}  // namespace

TEST_CASE("random colours fill the cube of colours and paint each node for itself",
          "[randomizers]") {
  Props props;
  RandomColors::Params params;
  params.color_min = Vec3(0.0, 0.2, 0.5);
  params.color_max = Vec3(1.0, 0.4, 0.6);
  RandomColors colors(params, props.host);
  std::vector<double> red, green, blue;
  for (int seed = 0; seed < kSeeds; ++seed) {
    colors.randomize(props.scene, {}, Rng(std::uint64_t(seed)));
    const Node& cube = props.scene[props.nodes[0]];
    REQUIRE(cube.materials.size() == 2);
    const Vec3f color = cube.materials[0]->base_color;
    CHECK(cube.materials[1]->base_color == color);
    CHECK(props.scene[props.nodes[1]].materials[0]->base_color != color);
    red.push_back(color.x());
    green.push_back(color.y());
    blue.push_back(color.z());
  }
  CHECK(fills(red, 0.0, 1.0));
  CHECK(fills(green, 0.2 - 1e-6, 0.4 + 1e-6));
  CHECK(fills(blue, 0.5 - 1e-6, 0.6 + 1e-6));
  const Node& cube = props.scene[props.nodes[0]];
  CHECK(cube.mesh == props.mesh);
  CHECK(cube.materials[0]->roughness == 0.33f);
  CHECK_FALSE(cube.materials[0]->base_color_texture);
  CHECK(props.original->base_color == Vec3f(1, 0, 0));
}

TEST_CASE("random materials change roughness and metalness alone", "[randomizers]") {
  Props props;
  RandomMaterial::Params params;
  params.roughness = {0.2, 0.9};
  params.metallic = {0.0, 1.0};
  RandomMaterial materials(params, props.host);
  std::vector<double> roughness, metallic;
  for (int seed = 0; seed < kSeeds; ++seed) {
    materials.randomize(props.scene, {}, Rng(std::uint64_t(seed)));
    const Material& material = *props.scene[props.nodes[1]].materials[1];
    roughness.push_back(material.roughness);
    metallic.push_back(material.metallic);
    CHECK(material.base_color == Vec3f(1, 0, 0));
    CHECK(material.base_color_texture.texture == props.original->base_color_texture.texture);
  }
  CHECK(fills(roughness, 0.2 - 1e-6, 0.9 + 1e-6));
  CHECK(fills(metallic, 0.0, 1.0));
}

TEST_CASE("visibility follows its chance", "[randomizers]") {
  Props props;
  RandomVisibility::Params params;
  params.nodes = "/Distractors/*";
  params.visible_chance = 0.3;
  RandomVisibility visibility(params, props.host);
  int shown = 0;
  int equal = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    visibility.randomize(props.scene, {}, Rng(std::uint64_t(seed)));
    const bool first = props.scene[props.nodes[0]].is_visible;
    shown += first ? 1 : 0;
    equal += first == props.scene[props.nodes[1]].is_visible ? 1 : 0;
  }
  // Binomial, four standard deviations: 150 +- 41; agreement of independent nodes 290 +- 44.
  CHECK(std::abs(shown - 150) < 41);
  CHECK(std::abs(equal - 290) < 44);
}

TEST_CASE("dome lights get every sky about equally often, turned about the vertical",
          "[randomizers]") {
  Props props;
  const NodeId sky = props.scene.create(props.scene.create(props.scene.root(), "Lights"), "sky_0");
  props.scene.edit(sky).light = Light{};
  props.scene.edit(sky).light->kind = LightKind::Dome;
  DomeLight::Params params;
  params.textures = {"dawn.hdr", "noon.hdr", "dusk.hdr", "night.hdr"};
  params.intensity = {0.5, 2.0};
  DomeLight dome(params, props.host);
  std::map<std::string, int> count;
  std::vector<double> angles, strengths;
  for (int seed = 0; seed < kSeeds; ++seed) {
    dome.randomize(props.scene, {}, Rng(std::uint64_t(seed)));
    const Light& light = *props.scene[sky].light;
    ++count[light.texture->name];
    strengths.push_back(light.color.x());
    const Mat3 rotation = props.scene.world_from_node(sky).linear();
    CHECK(rotation(2, 2) == Approx(1.0));
    double angle = std::atan2(rotation(1, 0), rotation(0, 0)) * 180.0 / kPi;
    angles.push_back(angle < 0.0 ? angle + 360.0 : angle);
  }
  CHECK(fills(angles, 0.0, 360.0));
  CHECK(fills(strengths, 0.5, 2.0));
  CHECK(count.size() == 4);
  // Binomial, four standard deviations: 125 +- 39.
  for (const auto& [name, times] : count) CHECK(std::abs(times - 125) < 39);
}
