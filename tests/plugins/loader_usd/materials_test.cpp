// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "loader_usd/udim_atlas.h"
#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {

using test::LoadedStage;
using test::TemporaryFolder;

namespace {

std::shared_ptr<const Texture> tile(int size, std::uint8_t red) {
  auto texture = std::make_shared<Texture>();
  texture->width = texture->height = size;
  texture->channels = 3;
  texture->color_space = ColorSpace::Srgb;
  for (int i = 0; i < size * size; ++i) texture->bytes.insert(texture->bytes.end(), {red, 0, 0});
  return texture;
}

// The red of the texel at (u, v), which counts from the lower left.
int red_at(const Texture& texture, const Vec2f& uv) {
  const int x = static_cast<int>(uv.x() * static_cast<float>(texture.width));
  const int y = static_cast<int>((1.0f - uv.y()) * static_cast<float>(texture.height));
  return texture.bytes.at(std::size_t((y * texture.width + x) * texture.channels));
}

/// A cube with a material whose surface is at `output`; `shaders` stand inside of it.
std::string stage(const std::string& output, const std::string& shaders) {
  return R"(#usda 1.0
def Cube "C"
{
    rel material:binding = </Mat>
}
def Material "Mat"
{
    token )" +
         output + R"(.connect = </Mat/S.outputs:out>
)" + shaders +
         "}\n";
}

}  // namespace

TEST_CASE("tiles of UDIM lie side by side, rows from the bottom", "[loader_usd]") {
  const std::vector<UdimTile> tiles{{1, 0, tile(2, 10)}, {2, 0, tile(4, 20)}, {1, 2, tile(4, 30)}};
  const auto atlas = make_udim_atlas("a", tiles);
  CHECK(atlas->width == 8);
  CHECK(atlas->height == 12);
  CHECK(atlas->color_space == ColorSpace::Srgb);
  const auto map = UdimRange::of(tiles).atlas_from_uv();
  const auto red = [&](float u, float v) { return red_at(*atlas, map * Vec3f(u, v, 1.0f)); };
  CHECK(red(1.1f, 0.1f) == 10);
  CHECK(red(1.9f, 0.9f) == 10);
  CHECK(red(2.5f, 0.5f) == 20);
  CHECK(red(1.5f, 2.5f) == 30);
  CHECK(red(1.5f, 1.5f) == 0);
}

TEST_CASE("a set of UDIM tiles is one texture with its own layout", "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("wood.1001.png", "x");
  folder.write("wood.1012.png", "x");
  const std::string shaders = R"(
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
        token outputs:out
    }
    def Shader "T"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @wood.<UDIM>.png@
        float3 outputs:rgb
    }
)";
  LoadedStage loaded(folder.write("a.usda", stage("outputs:surface", shaders)));
  const TextureInput& input = loaded.node("C").materials.at(0)->base_color_texture;
  REQUIRE(input);
  CHECK(loaded.host.warnings.empty());
  CHECK(loaded.host.decoded.size() == 2);
  CHECK(input.texture->width == 2);
  CHECK(input.texture->height == 2);
  const Vec2f mapped = input.uv_from_mesh_uv * Vec3f(1.5f, 1.5f, 1.0f);
  CHECK(mapped.isApprox(Vec2f(0.75f, 0.75f)));

  LoadedStage none(folder.write(
      "b.usda", stage("outputs:surface", shaders.substr(0, shaders.find("wood")) + "gone" +
                                             shaders.substr(shaders.find("wood") + 4))));
  REQUIRE(none.host.warnings.size() == 1);
  CHECK(none.host.warnings[0].ends_with(
      "texture @gone.<UDIM>.png@ could not be found (material 'Mat')"));
}

TEST_CASE("MaterialX surfaces are read through their nodes", "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("wood.png", "x");
  folder.write("rough.png", "x");
  LoadedStage loaded(folder.write("a.usda", stage("outputs:mtlx:surface", R"(
    def Shader "S"
    {
        uniform token info:id = "ND_standard_surface_surfaceshader"
        float inputs:base = 0.5
        color3f inputs:base_color.connect = </Mat/Graph.outputs:color>
        float inputs:metalness = 0.75
        float inputs:specular_roughness.connect = </Mat/Graph.outputs:rough>
        float inputs:specular_IOR = 1.7
        float inputs:coat = 0.25
        float inputs:emission = 3
        color3f inputs:emission_color = (1, 0.5, 0)
        token outputs:out
    }
    def NodeGraph "Graph"
    {
        color3f outputs:color.connect = </Mat/Graph/Tint.outputs:out>
        float outputs:rough.connect = </Mat/Graph/Pick.outputs:outg>
        def Shader "Tint"
        {
            uniform token info:id = "ND_multiply_color3"
            color3f inputs:in1.connect = </Mat/Graph/Wood.outputs:out>
            color3f inputs:in2 = (1, 1, 1)
            color3f outputs:out
        }
        def Shader "Wood"
        {
            uniform token info:id = "ND_tiledimage_color3"
            asset inputs:file = @wood.png@ (
                colorSpace = "srgb_texture"
            )
            float2 inputs:uvtiling = (3, 4)
            string inputs:uaddressmode = "mirror"
            color3f outputs:out
        }
        def Shader "Pick"
        {
            uniform token info:id = "ND_separate3_color3"
            color3f inputs:in.connect = </Mat/Graph/Rough.outputs:out>
            float outputs:outg
        }
        def Shader "Rough"
        {
            uniform token info:id = "ND_image_color3"
            asset inputs:file = @rough.png@
            color3f outputs:out
        }
    }
)")));
  CHECK(loaded.host.warnings.empty());
  const Material& material = *loaded.node("C").materials.at(0);
  CHECK(material.base_color.isApprox(Vec3f::Constant(0.5f)));
  REQUIRE(material.base_color_texture);
  CHECK(material.base_color_texture.texture->color_space == ColorSpace::Srgb);
  CHECK(material.base_color_texture.wrap_u == Wrap::Mirror);
  CHECK((material.base_color_texture.uv_from_mesh_uv * Vec3f(1, 1, 1)).isApprox(Vec2f(3, 4)));
  REQUIRE(material.roughness_texture);
  CHECK(material.roughness_texture.texture->color_space == ColorSpace::Linear);
  CHECK(material.roughness_texture.channel == 1);
  CHECK(material.metallic == 0.75f);
  CHECK(material.ior == 1.7f);
  CHECK(material.clearcoat == 0.25f);
  CHECK(material.emission.isApprox(Vec3f(3.0f, 1.5f, 0.0f)));
}

TEST_CASE("MaterialX surfaces have the fallbacks of their definitions", "[loader_usd]") {
  const TemporaryFolder folder;
  const auto material = [&](const std::string& id, const std::string& inputs) {
    LoadedStage loaded(folder.write("a.usda", stage("outputs:mtlx:surface", R"(
    def Shader "S"
    {
        uniform token info:id = ")" + id + R"("
        token outputs:out
)" + inputs + "\n    }\n")));
    return *loaded.node("C").materials.at(0);
  };
  const Material standard =
      material("ND_standard_surface_surfaceshader", "float inputs:emission = 2");
  CHECK(standard.base_color.isApprox(Vec3f::Constant(0.8f)));
  CHECK(standard.roughness == 0.2f);
  CHECK(standard.metallic == 0.0f);
  CHECK(standard.emission.isApprox(Vec3f::Constant(2.0f)));

  const Material open = material("ND_open_pbr_surface_surfaceshader",
                                 "float inputs:emission_luminance = 300\n"
                                 "float inputs:geometry_opacity = 0.5\n"
                                 "bool inputs:geometry_thin_walled = 1");
  CHECK(open.roughness == 0.3f);
  CHECK(open.emission.isApprox(Vec3f::Constant(300.0f)));
  CHECK(open.opacity == 0.5f);
  CHECK(open.is_thin_walled);

  const Material gltf = material("ND_gltf_pbr_surfaceshader", "float inputs:alpha = 0.25");
  CHECK(gltf.base_color.isApprox(Vec3f::Ones()));
  CHECK(gltf.metallic == 1.0f);
  CHECK(gltf.roughness == 1.0f);
  CHECK(gltf.emission.isZero());
  CHECK(gltf.opacity == 1.0f);
  const Material masked =
      material("ND_gltf_pbr_surfaceshader", "float inputs:alpha = 0.25\nint inputs:alpha_mode = 1");
  CHECK(masked.opacity == 0.25f);
  CHECK(masked.opacity_threshold == 0.5f);
}

TEST_CASE("a preview surface in MaterialX's words is one", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", stage("outputs:mtlx:surface", R"(
    def Shader "S"
    {
        uniform token info:id = "ND_UsdPreviewSurface_surfaceshader"
        color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
        float inputs:roughness = 0.125
        token outputs:out
    }
)")));
  const Material& material = *loaded.node("C").materials.at(0);
  CHECK(material.base_color.isApprox(Vec3f(0.1f, 0.2f, 0.3f)));
  CHECK(material.roughness == 0.125f);
}

namespace {

const std::string kSquare = R"(
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    rel material:binding = </Mat>
)";

std::string uvs(const std::string& name, const std::string& corner) {
  return "    texCoord2f[] primvars:" + name + " = [" + corner +
         "] ( interpolation = \"constant\" )\n";
}

std::string preview_material(const std::string& inputs, const std::string& shaders) {
  return R"(#usda 1.0
def Material "Mat"
{
    token outputs:surface.connect = </Mat/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
)" + inputs +
         "    }\n" + shaders + "}\n";
}

std::string texture(const std::string& name, const std::string& varname,
                    const std::string& more = "") {
  return R"(
    def Shader ")" +
         name + R"("
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @)" +
         name + R"(.png@
        float2 inputs:st.connect = </Mat/Reader)" +
         name + R"(.outputs:result>
)" + more +
         R"(    }
    def Shader "Reader)" +
         name + R"("
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        token inputs:varname = ")" +
         varname + R"("
    }
)";
}

}  // namespace

TEST_CASE("textures lie by the primvar that their reader names", "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("Base.png", "gray");
  folder.write("Rough.png", "gray");
  const std::string connected =
      "        color3f inputs:diffuseColor.connect = </Mat/Base.outputs:rgb>\n";
  const std::string mesh =
      "def Mesh \"M\"\n{" + kSquare + uvs("st", "(0, 0)") + uvs("ExportUV", "(0.25, 0.75)") + "}\n";
  LoadedStage loaded(
      folder.write("a.usda", preview_material(connected, texture("Base", "ExportUV")) + mesh));
  CHECK(loaded.node("M").mesh->uvs.at(0) == Vec2f(0.25f, 0.75f));
  CHECK(loaded.host.warnings.empty());
  LoadedStage several(folder.write(
      "b.usda", preview_material(
                    connected + "        float inputs:roughness.connect = </Mat/Rough.outputs:r>\n",
                    texture("Base", "ExportUV") + texture("Rough", "st")) +
                    mesh));
  REQUIRE(several.host.warnings.size() == 1);
  CHECK(several.host.warnings[0].ends_with(
      "</M> is textured by several primvars, of which the first one counts"));
}

TEST_CASE("a picture that is missing has its node's fallback", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write(
      "a.usda", preview_material(
                    "        color3f inputs:diffuseColor.connect = </Mat/Gone.outputs:rgb>\n"
                    "        float inputs:roughness.connect = </Mat/Gone.outputs:g>\n",
                    texture("Gone", "st", "        float4 inputs:fallback = (1, 0.5, 0.25, 1)\n")) +
                    "def Mesh \"M\"\n{" + kSquare + "}\n"));
  const Material& material = *loaded.node("M").materials.at(0);
  CHECK(material.base_color == Vec3f(1, 0.5f, 0.25f));
  CHECK(material.roughness == 0.5f);
}

TEST_CASE("colors of meshes count where their material reads them", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string reader = R"(
    def Shader "Color"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "displayColor"
        float3 inputs:fallback = (0, 0, 1)
    }
)";
  const std::string meshes =
      "def Mesh \"Varied\"\n{" + kSquare +
      "    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), "
      "(1, 1, 1)] ( interpolation = \"vertex\" )\n}\n"
      "def Mesh \"Even\"\n{" +
      kSquare +
      "    color3f[] primvars:displayColor = [(1, 0, 0)]\n}\n"
      "def Mesh \"Without\"\n{" +
      kSquare + "}\n";
  LoadedStage read(folder.write(
      "a.usda",
      preview_material(
          "        color3f inputs:diffuseColor.connect = </Mat/Color.outputs:result>\n", reader) +
          meshes));
  CHECK(read.node("Varied").mesh->colors.size() == 4);
  CHECK(read.node("Varied").materials.at(0)->base_color == Vec3f::Ones());
  CHECK(read.node("Even").materials.at(0)->base_color == Vec3f::UnitX());
  CHECK(read.node("Without").materials.at(0)->base_color == Vec3f::UnitZ());
  LoadedStage unread(folder.write(
      "b.usda",
      preview_material("        color3f inputs:diffuseColor = (0.5, 0.5, 0.5)\n", "") + meshes));
  CHECK(unread.node("Varied").mesh->colors.empty());
  CHECK(unread.node("Even").materials.at(0)->base_color == Vec3f::Constant(0.5f));
}

}  // namespace diorama::loader_usd
