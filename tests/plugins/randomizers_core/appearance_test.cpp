// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "dome_light.h"
#include "framework/pipeline/fake_host.h"
#include "random_colors.h"
#include "random_labels.h"
#include "random_material.h"
#include "random_texture.h"
#include "random_visibility.h"
#include "support/catch.h"
#include "support/statistics.h"

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
  params.color = Distribution::between({0.0, 0.2, 0.5}, {1.0, 0.4, 0.6});
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
  params.roughness = Range{0.2, 0.9};
  params.metallic = Range{0.0, 1.0};
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

TEST_CASE("whole materials come from assets, read once", "[randomizers]") {
  Props props;
  int loads = 0;
  for (const char* name : {"oak.usd", "steel.usd"}) {
    props.host.assets[name] = [&loads, name](Scene& scene, NodeId root) {
      ++loads;
      auto material = std::make_shared<Material>();
      material->name = name;
      scene.edit(root).materials = {nullptr, material};
    };
  }
  RandomMaterial::Params params;
  params.assets = TextDistribution({"oak.usd", "steel.usd"});
  params.roughness = 0.25;
  RandomMaterial materials(params, props.host);
  std::map<std::string, int> count;
  for (int seed = 0; seed < kSeeds; ++seed) {
    materials.randomize(props.scene, {}, Rng(std::uint64_t(seed)));
    const Material& material = *props.scene[props.nodes[0]].materials[0];
    ++count[material.name];
    CHECK(material.roughness == 0.25f);
  }
  CHECK(loads == 2);
  CHECK(std::abs(count["oak.usd"] - 250) < 45);  // binomial, four standard deviations
  CHECK(count["oak.usd"] + count["steel.usd"] == kSeeds);
  props.host.assets["bare.usd"] = [](Scene&, NodeId) {};
  params.assets = TextDistribution({"bare.usd"});
  RandomMaterial bare(params, props.host);
  CHECK_THROWS_WITH(bare.randomize(props.scene, {}, Rng(1)), "bare.usd: has no material");
}

TEST_CASE("random textures cover the mesh, repeated and turned", "[randomizers]") {
  Props props;
  RandomTexture::Params params;
  params.textures = TextDistribution({"wood.png", "cloth.png"});
  params.repeat = 3.0;
  params.rotation_deg = 90.0;
  RandomTexture textures(params, props.host);
  std::map<std::string, int> count;
  for (int seed = 0; seed < kSeeds; ++seed) {
    textures.randomize(props.scene, {}, Rng(std::uint64_t(seed)));
    ++count[props.scene[props.nodes[0]].materials[1]->base_color_texture.texture->name];
  }
  CHECK(std::abs(count["wood.png"] - 250) < 45);
  CHECK(count["wood.png"] + count["cloth.png"] == kSeeds);
  const Material& material = *props.scene[props.nodes[1]].materials[0];
  CHECK(material.base_color == Vec3f(1, 1, 1));
  CHECK(material.roughness == 0.33f);
  const Eigen::Vector3f uv(0.5f, 0.25f, 1.0f);
  CHECK((material.base_color_texture.uv_from_mesh_uv * uv - Vec2f(-0.75f, 1.5f)).norm() < 1e-5f);
}

TEST_CASE("labels are replaced, added and cleared", "[randomizers]") {
  Props props;
  props.scene.edit(props.nodes[0]).labels = {{"class", "cube"}, {"size", "small"}};
  RandomLabels::Params params;
  params.nodes = "/Distractors/cube";
  params.labels = TextDistribution({"box"});
  const Labels& labels = props.scene[props.nodes[0]].labels;
  params.mode = "add";
  RandomLabels(params, props.host).randomize(props.scene, {}, Rng(1));
  CHECK(labels == Labels{{"class", "box"}, {"size", "small"}});
  params.mode = "replace";
  params.taxonomy = "shape";
  RandomLabels(params, props.host).randomize(props.scene, {}, Rng(1));
  CHECK(labels == Labels{{"shape", "box"}});
  params.mode = "clear";
  RandomLabels(params, props.host).randomize(props.scene, {}, Rng(1));
  CHECK(labels.empty());
}

TEST_CASE("sequences go from node to node and from call to call", "[randomizers]") {
  Props props;
  RandomMaterial::Params params;
  Value items = Value::make_list();
  for (const double item : {0.1, 0.2, 0.3}) items.list.push_back(Value::number(item));
  Value sequence = Value::make_map();
  sequence.set("sequence", Value::make_map()).set("items", items);
  params.roughness = Distribution::parse(sequence, "roughness", {"Roughness."}, 1);
  RandomMaterial materials(params, props.host);
  std::vector<float> seen;
  for (int call = 0; call < 3; ++call) {
    RandomizeContext context;
    context.occurrence = call;
    materials.randomize(props.scene, context, Rng(std::uint64_t(call)));
    for (const NodeId node : props.nodes) {
      seen.push_back(props.scene[node].materials[0]->roughness);
    }
  }
  CHECK(seen == std::vector<float>{0.1f, 0.2f, 0.3f, 0.1f, 0.2f, 0.3f});
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
  params.textures = TextDistribution({"dawn.hdr", "noon.hdr", "dusk.hdr", "night.hdr"});
  params.intensity = Range{0.5, 2.0};
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
