// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <filesystem>
#include <map>
#include <set>

#include "box_mapping.h"
#include "diorama/error.h"
#include "framework/pipeline/fake_host.h"
#include "material_folder.h"
#include "random_material.h"
#include "random_texture.h"
#include "random_variant.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// One material of each collection, as their archives unpack, and what else lies about.
struct Shelf {
  TemporaryFolder folder;
  FakeHost host;
  Shelf() {
    for (const char* map : {"AmbientOcclusion", "Color", "Displacement", "Metalness", "NormalDX",
                            "NormalGL", "Roughness", "Opacity"}) {
      folder.write(std::string("Metal_051/Metal_051_2K-JPG_") + map + ".jpg", "x");
    }
    folder.write("Metal_051/Metal_051.png", "x");
    folder.write("Metal_051/Metal_051_2K-JPG.usdc", "x");
    for (const char* map : {"ao", "arm", "diff", "disp", "nor_dx", "spec_ior"}) {
      folder.write(std::string("brick_wall/textures/brick_wall_") + map + "_1k.png", "x");
    }
    folder.write("brick_wall/brick_wall_1k.blend", "x");
    folder.write("empty/readme.txt", "x");
  }
  std::vector<MaterialMaps> all() { return find_materials(folder.path(""), host); }
};

std::string texture_name(const TextureInput& input) {
  return input ? std::filesystem::path(input.texture->name).filename().string() : "";
}

/// A box without uv, scaled by two; each side is a quarter as long as the next.
struct Block {
  Scene scene;
  NodeId node;
  Block() {
    Mesh mesh = make_box(Vec3(0.5, 2, 8));
    mesh.uvs.clear();
    node = scene.create(scene.create(scene.root(), "Distractors"), "block");
    scene.edit(node).mesh = std::make_shared<const Mesh>(mesh);
    scene.set_pose(node, Affine(Eigen::UniformScaling<double>(2.0)));
  }
};

}  // namespace

TEST_CASE("names of pictures are taken apart as their collections put them together",
          "[randomizers]") {
  const auto is = [](const char* file, const char* material, MapRole role) {
    const auto name = map_name(file);
    return name && name->material == material && name->role == role;
  };
  CHECK(is("Wood051_1K-JPG_Color.jpg", "wood051", MapRole::Color));
  CHECK(is("Wood051_1K_NormalGL.png", "wood051", MapRole::NormalGl));
  CHECK(is("Wood051_8K-PNG_NormalDX.png", "wood051", MapRole::NormalDx));
  CHECK(is("Wood051_1K-JPG_AmbientOcclusion.jpg", "wood051", MapRole::Ignored));
  CHECK(is("brick_wall_001_diff_1k.jpg", "brick_wall_001", MapRole::Color));
  CHECK(is("brick_wall_001_diffuse_4k.exr", "brick_wall_001", MapRole::Color));
  CHECK(is("brick_wall_001_nor_gl_2k.exr", "brick_wall_001", MapRole::NormalGl));
  CHECK(is("brick_wall_001_nor_dx_2k.PNG", "brick_wall_001", MapRole::NormalDx));
  CHECK(is("brick_wall_001_rough_16k.png", "brick_wall_001", MapRole::Roughness));
  CHECK(is("brick_wall_001_arm_1k.jpg", "brick_wall_001", MapRole::Arm));
  CHECK(is("rusty_metal_metal_1k.png", "rusty_metal", MapRole::Metalness));
  CHECK(is("metal_plate_rough_1k.png", "metal_plate", MapRole::Roughness));
  CHECK(is("oak-base_color.tga", "oak", MapRole::Color));
  CHECK(is("fabric_pattern_05_col_01_1k.png", "fabric_pattern_05", MapRole::Color));
  CHECK(is("Bricks_4K-TIF_Roughness.tif", "bricks", MapRole::Roughness));
  CHECK(is("oak_Color.webp", "oak", MapRole::Color));
  for (const char* other : {"Wood051.png", "color.png", "wood_color.txt", "wood_colorful.png",
                            "Wood051_1K.png", "_1K_.png", ".png", ""}) {
    CAPTURE(other);
    CHECK_FALSE(map_name(other));
  }
}

TEST_CASE("a folder's materials are found at any depth, with what each picture is for",
          "[randomizers]") {
  Shelf shelf;
  const std::vector<MaterialMaps> found = shelf.all();
  REQUIRE(found.size() == 2);
  CHECK(shelf.host.warnings.empty());
  MaterialReader reader(shelf.host);
  const Material metal = reader.read(found[0]);
  CHECK(metal.name == "metal_051");
  CHECK(texture_name(metal.base_color_texture) == "Metal_051_2K-JPG_Color.jpg");
  CHECK(metal.base_color_texture.texture->color_space == ColorSpace::Srgb);
  CHECK(texture_name(metal.roughness_texture) == "Metal_051_2K-JPG_Roughness.jpg");
  CHECK(metal.roughness_texture.texture->color_space == ColorSpace::Linear);
  CHECK(texture_name(metal.metallic_texture) == "Metal_051_2K-JPG_Metalness.jpg");
  CHECK(texture_name(metal.normal_texture) == "Metal_051_2K-JPG_NormalGL.jpg");
  CHECK(metal.normal_texture.scale == std::array<float, 4>{2, 2, 2, 1});
  CHECK(metal.normal_texture.bias == std::array<float, 4>{-1, -1, -1, 0});
  CHECK(texture_name(metal.opacity_texture) == "Metal_051_2K-JPG_Opacity.jpg");
  CHECK(metal.opacity_threshold == 0.5f);

  const Material wall = reader.read(found[1]);
  CHECK(wall.name == "brick_wall");
  CHECK(texture_name(wall.roughness_texture) == "brick_wall_arm_1k.png");
  CHECK(wall.roughness_texture.channel == 1);
  CHECK(wall.metallic_texture.channel == 2);
  CHECK(wall.roughness_texture.texture == wall.metallic_texture.texture);
  // Green is down in DirectX's maps: 0 is +1.
  CHECK(texture_name(wall.normal_texture) == "brick_wall_nor_dx_1k.png");
  CHECK(wall.normal_texture.scale == std::array<float, 4>{2, -2, 2, 1});
  CHECK(wall.normal_texture.bias == std::array<float, 4>{-1, 1, -1, 0});
  // Read once while something uses it.
  CHECK(reader.read(found[0]).base_color_texture.texture == metal.base_color_texture.texture);
}

TEST_CASE("a folder without materials is an error that says what one is", "[randomizers]") {
  Shelf shelf;
  const std::string expected =
      ": holds no material, expected pictures named as those of ambientCG or Poly Haven: "
      "'Wood051_1K-JPG_Color.jpg', 'brick_wall_diff_1k.png'";
  RandomMaterial::Params params;
  params.folders = {shelf.folder.path("brick_wall"), shelf.folder.path("empty")};
  CHECK_THROWS_WITH(RandomMaterial(params, shelf.host), shelf.folder.path("empty") + expected);
  shelf.folder.write("lonely/oak_rough_1k.png", "x");
  params.folders = {shelf.folder.path("lonely")};
  CHECK_THROWS_WITH(RandomMaterial(params, shelf.host), shelf.folder.path("lonely") + expected);
  params.folders = {shelf.folder.path("empty/readme.txt")};
  CHECK_THROWS_WITH(RandomMaterial(params, shelf.host), shelf.folder.path("empty/readme.txt") +
                                                            ": is a file, expected a folder of "
                                                            "materials");
  params.folders = {shelf.folder.path("brick_wall")};
  params.assets = TextDistribution({"oak.usd"});
  CHECK_THROWS_WITH(RandomMaterial(params, shelf.host),
                    ContainsSubstring("both 'assets' and 'folders' are given"));
}

TEST_CASE("displacement is told, as a warning where no normals show the relief", "[randomizers]") {
  Shelf shelf;
  for (const char* map : {"Color", "Displacement"}) {
    shelf.folder.write(std::string("flat/Tiles_1K-PNG_") + map + ".png", "x");
  }
  shelf.folder.write("plain/oak_diff_1k.png", "x");
  const std::vector<MaterialMaps> found = shelf.all();
  CHECK(found.size() == 4);
  for (const MaterialMaps& maps : found) CHECK_FALSE(maps.files.contains(MapRole::Displacement));
  REQUIRE(shelf.host.warnings.size() == 1);
  CHECK(shelf.host.warnings[0] ==
        shelf.folder.path("") +
            ": materials with displacement, which moves no surface here: 1 without normals, which "
            "look flat");
}

TEST_CASE("each node gets one of the materials, and its pictures count", "[randomizers]") {
  Shelf shelf;
  Block block;
  const NodeId other = block.scene.create(block.scene[block.node].parent, "other");
  block.scene.edit(other).mesh = std::make_shared<const Mesh>(make_box(Vec3(1, 1, 1)));
  RandomMaterial::Params params;
  params.folders = {shelf.folder.path("")};
  params.repeat = 3.0;
  params.roughness = 0.25;
  params.metallic = 0.75;
  RandomMaterial materials(params, shelf.host);
  std::set<std::string> seen;
  for (int seed = 0; seed < 40; ++seed) {
    materials.randomize(block.scene, {}, Rng(std::uint64_t(seed)));
    const Material& material = *block.scene[other].materials.at(0);
    seen.insert(material.name);
    CHECK(material.roughness_texture);
    CHECK(material.metallic_texture);
    const Eigen::Matrix<float, 2, 3>& map = material.roughness_texture.uv_from_mesh_uv;
    CHECK((map.leftCols<2>() - 3.0f * Eigen::Matrix2f::Identity()).norm() < 1e-5f);
  }
  CHECK(seen == std::set<std::string>{"brick_wall", "metal_051"});
}

TEST_CASE("a mesh without uv gets some by box mapping, in metres, whatever its scale",
          "[randomizers]") {
  Shelf shelf;
  Block block;
  const std::shared_ptr<const Mesh> source = block.scene[block.node].mesh;
  RandomMaterial::Params params;
  params.folders = {shelf.folder.path("brick_wall")};
  params.picture_m = 0.5;
  RandomMaterial materials(params, shelf.host);
  std::shared_ptr<const Mesh> mapped;
  for (int call = 0; call < 3; ++call) {
    materials.randomize(block.scene, {}, Rng(std::uint64_t(call)));
    const Mesh& mesh = *block.scene[block.node].mesh;
    mesh.validate("mapped");
    if (mapped) CHECK(block.scene[block.node].mesh == mapped);
    mapped = block.scene[block.node].mesh;
    REQUIRE(mesh.triangles.size() == source->triangles.size());
    CHECK(mesh.normals.size() == mesh.positions.size());
    const auto& map = block.scene[block.node].materials.at(0)->base_color_texture.uv_from_mesh_uv;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const auto& corner = mesh.triangles[i];
      const auto place = [&](std::size_t k) { return mesh.positions[corner[k]]; };
      const auto uv = [&](std::size_t k) -> Vec2f {
        return map * mesh.uvs[corner[k]].homogeneous();
      };
      for (std::size_t k = 0; k < 3; ++k) {
        CHECK(place(k) == source->positions[source->triangles[i][k]]);
        // Lengths on the picture are those in the world, which is twice as large as the mesh.
        const double edge = 2.0 * (place((k + 1) % 3) - place(k)).norm();
        CHECK((uv((k + 1) % 3) - uv(k)).norm() == Approx(edge / 0.5).epsilon(1e-5));
      }
      // Nothing is mirrored.
      const Vec2f a = uv(1) - uv(0);
      const Vec2f b = uv(2) - uv(0);
      CHECK(a.x() * b.y() - a.y() * b.x() > 0.0f);
    }
  }
  // A mesh that has its own keeps them, and so does one that gets no whole material.
  Block plain;
  const auto before = plain.scene[plain.node].mesh;
  RandomMaterial(RandomMaterial::Params{}, shelf.host).randomize(plain.scene, {}, Rng(1));
  CHECK(plain.scene[plain.node].mesh == before);
  Mesh with_uvs = make_box(Vec3(1, 2, 3));
  plain.scene.edit(plain.node).mesh = std::make_shared<const Mesh>(with_uvs);
  const auto own = plain.scene[plain.node].mesh;
  materials.randomize(plain.scene, {}, Rng(1));
  CHECK(plain.scene[plain.node].mesh == own);
}

TEST_CASE("objects get the looks of a variant of their asset", "[randomizers]") {
  FakeHost host;
  const auto body = std::make_shared<const Mesh>(make_box(Vec3(1, 2, 3)));
  const auto lid = std::make_shared<const Mesh>(make_box(Vec3(1, 2, 0.5)));
  const auto add = [&](const std::string& look, bool has_lid) {
    auto material = std::make_shared<Material>();
    material->name = look;
    host.assets["mug.usd{look=" + look + "}"] = [=](Scene& scene, NodeId root) {
      const NodeId part = scene.create(root, "Body");
      scene.edit(part).mesh = body;
      scene.edit(part).materials = {material};
      if (has_lid) scene.edit(scene.create(root, "Lid")).mesh = lid;
    };
  };
  add("red", true);
  add("blue", true);
  add("open", false);
  Scene scene;
  const NodeId assets = scene.create(scene.root(), "Assets");
  for (const char* name : {"falling_mug", "falling_mug_01"}) {
    host.load_asset("mug.usd{look=red}", scene, scene.create(assets, name));
  }
  RandomVariant::Params params;
  params.asset = "mug.usd";
  Value list = Value::make_list();
  for (const char* look : {"red", "blue", "open"}) list.list.push_back(Value::text(look));
  params.variants = Value::make_map();
  params.variants.set("look", list);
  RandomVariant variants(params, host);
  std::map<std::string, int> count;
  bool differs = false;
  for (int seed = 0; seed < 60; ++seed) {
    variants.randomize(scene, {}, Rng(std::uint64_t(seed)));
    const Node& part = scene[scene.require("/Assets/falling_mug/loaded/Body")];
    const NodeId top = scene.require("/Assets/falling_mug/loaded/Lid");
    const std::string look = part.materials.at(0)->name;
    ++count[look];
    CHECK(part.mesh == body);
    CHECK(scene.is_visible(top) == (look != "open"));
    const Node& other = scene[scene.require("/Assets/falling_mug_01/loaded/Body")];
    differs |= other.materials.at(0)->name != look;
  }
  CHECK(count.size() == 3);
  CHECK(differs);
  // What is as it should be is not touched.
  variants.randomize(scene, {}, Rng(1));
  const std::uint64_t revision = scene.shape_revision();
  variants.randomize(scene, {}, Rng(1));
  CHECK(scene.shape_revision() == revision);

  Scene bare;
  host.load_asset("mug.usd{look=open}", bare,
                  bare.create(bare.create(bare.root(), "Assets"), "mug"));
  list.list = {Value::text("red")};
  params.variants.set("look", list);
  CHECK_THROWS_WITH(
      RandomVariant(params, host).randomize(bare, {}, Rng(1)),
      ContainsSubstring("/Assets/mug: has no part 'loaded/Lid' as mug.usd{look=red} has"));
  RandomVariant({}, host).randomize(bare, {}, Rng(1));
  RandomVariant::Params nameless = params;
  nameless.asset.clear();
  CHECK_THROWS_WITH(RandomVariant(nameless, host),
                    "asset: is empty, expected the file that the nodes are made of");
  params.variants = Value::text("red");
  CHECK_THROWS_WITH(RandomVariant(params, host),
                    ContainsSubstring("expected lists by set: {lookVariant: [red, blue]}"));
}

TEST_CASE("random textures lie on meshes without uv, too", "[randomizers]") {
  FakeHost host;
  Block block;
  RandomTexture::Params params;
  params.textures = TextDistribution({"wood.png"});
  params.repeat = 2.0;
  params.picture_m = 0.25;
  RandomTexture textures(params, host);
  for (int call = 0; call < 2; ++call) {
    textures.randomize(block.scene, {}, Rng(1));
    CHECK_FALSE(block.scene[block.node].mesh->uvs.empty());
    const auto& map = block.scene[block.node].materials.at(0)->base_color_texture.uv_from_mesh_uv;
    // Two pictures in 0.25 m of the world, of which a unit of the mesh has two.
    CHECK((map.leftCols<2>() - 16.0f * Eigen::Matrix2f::Identity()).norm() < 1e-4f);
  }
}
