// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <string>

#include "diorama/error.h"
#include "plugins/loader_assimp/loaded_file.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_assimp {

using test::LoadedFile;
using test::TemporaryFolder;

namespace {

/// A triangle (0,0,0) (1,0,0) (0,2,0) with texture coordinates (0,0) (1,0) (0,1) counted from the
/// upper left, and three indices: buffer views 0 to 2, accessors 0 to 2.
const std::string kBuffer = test::bytes_of<float>({0, 0, 0, 1, 0, 0, 0, 2, 0}) +
                            test::bytes_of<float>({0, 0, 1, 0, 0, 1}) +
                            test::bytes_of<std::uint16_t>({0, 1, 2});
const std::string kViews = R"({"buffer": 0, "byteOffset": 0, "byteLength": 36},
  {"buffer": 0, "byteOffset": 36, "byteLength": 24}, {"buffer": 0, "byteOffset": 60, "byteLength": 6})";
const std::string kAccessors = R"("accessors": [
  {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0,0,0], "max": [1,2,0]},
  {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
  {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"}])";
const std::string kMesh = R"("meshes": [{"primitives": [{"attributes": {"POSITION": 0,
  "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}])";

std::string gltf(const std::string& buffer, const std::string& views, const std::string& rest) {
  return R"({"asset": {"version": "2.0"}, "scene": 0, "buffers": [{"byteLength": )" +
         std::to_string(buffer.size()) + R"(, "uri": "data:application/octet-stream;base64,)" +
         test::base64(buffer) + R"("}], "bufferViews": [)" + views + "], " + rest + "}";
}

std::string little_endian(std::size_t number) {
  return test::bytes_of<std::uint32_t>({static_cast<std::uint32_t>(number)});
}

/// The two chunks of a GLB.
std::string glb(std::string json, std::string binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  return "glTF" + little_endian(2) + little_endian(28 + json.size() + binary.size()) +
         little_endian(json.size()) + "JSON" + json + little_endian(binary.size()) +
         std::string("BIN\0", 4) + binary;
}

}  // namespace

TEST_CASE("glTF: y up becomes z up, and nodes of one mesh share it", "[loader_assimp]") {
  const TemporaryFolder folder;
  const LoadedFile loaded(folder.write(
      "a.gltf", gltf(kBuffer, kViews, kAccessors + "," + kMesh + R"(, "materials": [{}],
  "nodes": [{"name": "Part", "mesh": 0, "translation": [10, 0, 0]},
            {"name": "Part", "mesh": 0, "scale": [2, 2, 2]},
            {"name": "Group/1", "children": [3]}, {"mesh": 0, "translation": [0, 0, 5]}],
  "scenes": [{"nodes": [0, 1, 2]}])")));
  CHECK(loaded.host.messages.empty());
  const auto& children = loaded.scene[loaded.root].children;
  REQUIRE(children.size() == 3);
  CHECK(loaded.scene[children[0]].name == "Part");
  CHECK(loaded.scene[children[1]].name == "Part_01");
  CHECK(loaded.scene[children[2]].name == "Group_1");
  const auto mesh = loaded.node("Part").mesh;
  REQUIRE(mesh);
  CHECK(loaded.node("Part_01").mesh == mesh);
  const NodeId deep = loaded.node("Group_1").children.at(0);
  CHECK(loaded.scene[deep].mesh == mesh);
  CHECK(loaded.node("Part").materials.at(0) == loaded.scene[deep].materials.at(0));
  // The triangle stands upright and looks at -y.
  const Aabb bounds = loaded.scene.world_bounds(loaded.id("Part"));
  CHECK((bounds.min - Vec3(10, 0, 0)).norm() < 1e-6);
  CHECK((bounds.max - Vec3(11, 0, 2)).norm() < 1e-6);
  CHECK(loaded.scene.world_bounds(deep).max.isApprox(Vec3(1, -5, 2), 1e-6));
  // Mesh uv counts from the lower left.
  CHECK(mesh->uvs == std::vector<Vec2f>{{0, 1}, {1, 1}, {0, 0}});
  // Without normals it is flat.
  CHECK(mesh->normals.empty());
}

TEST_CASE("glTF: materials keep their factors, channels and layout", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string png = test::red_green_png();
  const std::string views = kViews + R"(, {"buffer": 0, "byteOffset": 68, "byteLength": )" +
                            std::to_string(png.size()) + "}";
  const LoadedFile loaded(folder.write(
      "a.gltf", gltf(kBuffer + std::string(2, '\0') + png, views, kAccessors + "," + kMesh + R"(,
  "images": [{"bufferView": 3, "mimeType": "image/png"}],
  "samplers": [{"wrapS": 33071, "wrapT": 33648}], "textures": [{"source": 0, "sampler": 0}],
  "extensionsUsed": ["KHR_texture_transform", "KHR_materials_transmission"],
  "materials": [{"name": "Paint", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
    "emissiveFactor": [1, 0.5, 0],
    "normalTexture": {"index": 0, "scale": 0.5},
    "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5}},
    "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1], "metallicFactor": 0.75,
      "roughnessFactor": 0.5, "metallicRoughnessTexture": {"index": 0},
      "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform":
        {"offset": [0.25, 0.125], "scale": [2, 4]}}}}}],
  "nodes": [{"name": "Part", "mesh": 0}], "scenes": [{"nodes": [0]}])")));
  CHECK(loaded.host.messages.empty());
  const Node& part = loaded.node("Part");
  const Material& paint = *part.materials.at(0);
  CHECK(paint.name == "Paint");
  CHECK(paint.base_color.isApprox(Vec3f(0.2f, 0.4f, 0.6f)));
  CHECK(paint.emission.isApprox(Vec3f(1.0f, 0.5f, 0.0f)));
  CHECK(paint.opacity_threshold == 0.25f);
  CHECK(paint.transmission == 0.5f);
  CHECK(part.mesh->is_double_sided);
  const TextureInput& base = paint.base_color_texture;
  REQUIRE(base);
  CHECK(base.wrap_u == Wrap::Clamp);
  CHECK(base.wrap_v == Wrap::Mirror);
  CHECK(base.texture->color_space == ColorSpace::Srgb);
  // (u, v) from the upper left goes to (2 u + 0.25, 4 v + 0.125); ours count from the lower left.
  const Vec2f mapped = base.uv_from_mesh_uv * Vec3f(0.5f, 0.75f, 1.0f);
  CHECK(mapped.isApprox(Vec2f(1.25f, 1.0f - (4 * 0.25f + 0.125f)), 1e-5f));
  REQUIRE(paint.roughness_texture);
  CHECK(paint.roughness_texture.channel == 1);
  CHECK(paint.roughness_texture.scale[1] == 0.5f);
  CHECK(paint.roughness_texture.texture->color_space == ColorSpace::Linear);
  CHECK(paint.metallic_texture.channel == 2);
  CHECK(paint.metallic_texture.scale[2] == 0.75f);
  CHECK(paint.normal_texture.scale[0] == 1.0f);
  CHECK(paint.normal_texture.bias[0] == -0.5f);
  CHECK(paint.normal_texture.bias[2] == -1.0f);
}

TEST_CASE("glTF: a turned texture turns about its upper left corner", "[loader_assimp]") {
  const TemporaryFolder folder;
  folder.write("a.png", test::red_green_png());
  const LoadedFile loaded(
      folder.write("a.gltf", gltf(kBuffer, kViews, kAccessors + "," + kMesh + R"(,
  "images": [{"uri": "a.png"}], "textures": [{"source": 0}],
  "extensionsUsed": ["KHR_texture_transform"],
  "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
    {"KHR_texture_transform": {"rotation": 1.57079632679}}}}}],
  "nodes": [{"name": "Part", "mesh": 0}], "scenes": [{"nodes": [0]}])")));
  const TextureInput& base = loaded.node("Part").materials.at(0)->base_color_texture;
  REQUIRE(base);
  // Counter-clockwise as one sees the picture: u = 1 goes to v = -1 where v points down.
  const Vec2f mapped = base.uv_from_mesh_uv * Vec3f(1.0f, 1.0f, 1.0f);
  CHECK((mapped - Vec2f(0.0f, 2.0f)).norm() < 1e-5f);
}

TEST_CASE("glTF: lights in watts, cameras with their angle, both at their node",
          "[loader_assimp]") {
  const TemporaryFolder folder;
  const LoadedFile loaded(folder.write("a.gltf", R"({"asset": {"version": "2.0"}, "scene": 0,
  "extensionsUsed": ["KHR_lights_punctual"],
  "extensions": {"KHR_lights_punctual": {"lights": [
    {"type": "point", "color": [1, 0.5, 0], "intensity": 683},
    {"type": "spot", "intensity": 1366, "spot": {"innerConeAngle": 0.3, "outerConeAngle": 0.6}},
    {"type": "directional", "intensity": 2049}]}},
  "cameras": [{"type": "perspective", "perspective":
    {"yfov": 0.8, "aspectRatio": 2, "znear": 0.1, "zfar": 50}}],
  "nodes": [{"name": "Lamps", "scale": [2, 2, 2], "children": [1, 2]},
    {"name": "Bulb", "translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
    {"name": "Spot", "extensions": {"KHR_lights_punctual": {"light": 1}}},
    {"name": "Sun", "rotation": [-0.70710678, 0, 0, 0.70710678],
     "extensions": {"KHR_lights_punctual": {"light": 2}}},
    {"name": "Eye", "translation": [4, 5, 6], "camera": 0}],
  "scenes": [{"nodes": [0, 3, 4]}]})"));
  const Affine bulb = loaded.scene.world_from_node(loaded.id("Lamps/Bulb"));
  CHECK(bulb.translation().isApprox(Vec3(2, -6, 4), 1e-6));
  CHECK(bulb.linear().determinant() == Approx(1.0));
  const Light& point = *loaded.node("Lamps/Bulb").light;
  const double disc = kPi * point.radius_m * point.radius_m;
  CHECK(double(point.color.x()) * disc == Approx(1.0));
  CHECK(double(point.color.y()) * disc == Approx(0.5));
  const Light& spot = *loaded.node("Lamps/Spot").light;
  CHECK(double(spot.color.x()) * disc == Approx(2.0));
  CHECK(spot.cone_angle_rad == Approx(0.6));
  CHECK(spot.cone_softness == Approx(0.5));
  const Light& sun = *loaded.node("Sun").light;
  CHECK(sun.kind == LightKind::Distant);
  CHECK(sun.color.x() == Approx(3.0f));
  // It looks along -z, turned to -y: downwards here.
  const Affine sun_pose = loaded.scene.world_from_node(loaded.id("Sun"));
  CHECK((sun_pose.linear() * -Vec3::UnitZ()).isApprox(-Vec3::UnitZ(), 1e-6));

  const Affine eye = loaded.scene.world_from_node(loaded.id("Eye"));
  CHECK(eye.translation().isApprox(Vec3(4, -6, 5), 1e-6));
  CHECK((eye.linear() * -Vec3::UnitZ()).isApprox(Vec3::UnitY(), 1e-6));
  const Camera& camera = *loaded.node("Eye").camera;
  CHECK(2.0 * std::atan(0.5 * camera.height / camera.fy) == Approx(0.8).epsilon(1e-3));
  CHECK(camera.width == 2 * camera.height);
  CHECK(camera.near_m == Approx(0.1));
  CHECK(camera.far_m == Approx(50.0));
}

TEST_CASE("glTF: skinned points stand where their joints put them", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string buffer =
      kBuffer + std::string(2, '\0') +
      test::bytes_of<std::uint8_t>({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}) +
      test::bytes_of<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}) +
      test::bytes_of<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  const std::string views = kViews + R"(, {"buffer": 0, "byteOffset": 68, "byteLength": 12},
    {"buffer": 0, "byteOffset": 80, "byteLength": 48}, {"buffer": 0, "byteOffset": 128, "byteLength": 64})";
  std::string accessors = kAccessors;
  accessors.pop_back();
  accessors += R"(, {"bufferView": 3, "componentType": 5121, "count": 3, "type": "VEC4"},
    {"bufferView": 4, "componentType": 5126, "count": 3, "type": "VEC4"},
    {"bufferView": 5, "componentType": 5126, "count": 1, "type": "MAT4"}])";
  const LoadedFile loaded(folder.write("a.gltf", gltf(buffer, views, accessors + R"(,
  "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4},
    "indices": 2}]}],
  "skins": [{"joints": [1], "inverseBindMatrices": 5}],
  "nodes": [{"name": "Body", "mesh": 0, "skin": 0, "translation": [100, 0, 0]},
            {"name": "Joint", "translation": [0, 7, 0]}],
  "scenes": [{"nodes": [0, 1]}])")));
  // The joint counts, the pose of the mesh's node does not.
  const Aabb bounds = loaded.bounds();
  CHECK((bounds.min - Vec3(0, 0, 7)).norm() < 1e-4);
  CHECK((bounds.max - Vec3(1, 0, 9)).norm() < 1e-4);
}

TEST_CASE("GLB: an embedded picture is decoded", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string png = test::red_green_png();
  const std::string binary = kBuffer + std::string(2, '\0') + png;
  const std::string json =
      R"({"asset": {"version": "2.0"}, "scene": 0, "buffers": [{"byteLength": )" +
      std::to_string(binary.size()) + R"(}], "bufferViews": [)" + kViews +
      R"(, {"buffer": 0, "byteOffset": 68, "byteLength": )" + std::to_string(png.size()) + "}], " +
      kAccessors + "," + kMesh + R"(, "images": [{"bufferView": 3, "mimeType": "image/png"}],
  "textures": [{"source": 0}],
  "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
  "nodes": [{"name": "Part", "mesh": 0}], "scenes": [{"nodes": [0]}]})";
  const std::string file = folder.write("a.glb", glb(json, binary));
  const LoadedFile loaded(file);
  CHECK(loaded.host.messages.empty());
  const TextureInput& base = loaded.node("Part").materials.at(0)->base_color_texture;
  REQUIRE(base);
  CHECK(base.texture->name.starts_with(file + "["));
  CHECK(base.texture->width == 2);
  const std::vector<std::uint8_t>& bytes = base.texture->bytes;
  REQUIRE(bytes.size() >= 6);
  CHECK(bytes[0] == 255);
  CHECK(bytes[std::size_t(base.texture->channels)] == 0);

  // Cut anywhere, it is refused or read in part, never worse.
  const std::string whole = glb(json, binary);
  for (const std::size_t size : {std::size_t(11), std::size_t(30), whole.size() / 2}) {
    CHECK_THROWS_AS(LoadedFile(folder.write("cut.glb", whole.substr(0, size))), Error);
  }
}

}  // namespace diorama::loader_assimp
