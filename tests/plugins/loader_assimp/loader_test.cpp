// SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>

#include <assimp/Importer.hpp>

#include "diorama/error.h"
#include "plugins/loader_assimp/loaded_file.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_assimp {

using test::LoadedFile;
using test::TemporaryFolder;

namespace {

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

}  // namespace

TEST_CASE("every ending that is claimed is one that assimp knows", "[loader_assimp]") {
  test::RenderHost host{1};
  const Assimp::Importer importer;
  const auto claims = AssimpLoader({}, host).claims();
  CHECK(claims.size() > 30);
  for (const std::string& claim : claims) {
    INFO(claim);
    CHECK(importer.IsExtensionSupported(claim.c_str()));
  }
}

TEST_CASE("a missing texture is one warning that names file and texture", "[loader_assimp]") {
  const TemporaryFolder folder;
  folder.write("a.mtl",
               "newmtl A\nmap_Kd pictures\\wood.png\nnewmtl B\nmap_Kd pictures\\wood.png\n");
  const std::string file =
      folder.write("a.obj", "mtllib a.mtl\n" + kTriangle +
                                "o A\nusemtl A\nf 1/1 2/2 3/3\no B\nusemtl B\nf 1/1 2/2 3/3\n");
  const LoadedFile loaded(file);
  const std::string line =
      file + ": texture @pictures/wood.png@ could not be found (materials 'A', 'B')";
  CHECK(loaded.host.messages == std::vector<std::string>{line});
  CHECK_FALSE(loaded.node("A").materials.at(0)->base_color_texture);

  AssimpLoader::Params strict;
  strict.missing_assets_are_errors = true;
  CHECK_THROWS_WITH(LoadedFile(file, strict), line);
}

TEST_CASE("a material library that is a pipe is not waited for", "[loader_assimp]") {
  const TemporaryFolder folder;
  REQUIRE(::mkfifo(folder.path("a.mtl").c_str(), 0600) == 0);
  const std::string file =
      folder.write("a.obj", "mtllib a.mtl\n" + kTriangle + "o A\nusemtl A\nf 1/1 2/2 3/3\n");
  const LoadedFile loaded(file);
  CHECK(loaded.node("A").mesh != nullptr);
}

TEST_CASE("a model's files are its material library, buffers and pictures", "[loader_assimp]") {
  const TemporaryFolder folder;
  folder.write("textures/wood.png", "x");
  folder.write("unused.png", "x");
  folder.write("a.mtl", "newmtl A\nmap_Kd C:\\pictures\\wood.png\nmap_Bump gone.png\n");
  const std::string obj =
      folder.write("a.obj", "mtllib a.mtl\n" + kTriangle + "usemtl A\nf 1/1 2/2 3/3\n");
  test::RenderHost host{1};
  const auto names = [&](const std::string& file) {
    std::vector<std::string> result;
    for (const auto& path : AssimpLoader({}, host).files(file)) result.push_back(path.filename());
    return result;
  };
  CHECK(names(obj) == std::vector<std::string>{"a.obj", "a.mtl", "wood.png"});

  folder.write("points.bin", std::string(36, '\0'));
  const std::string gltf = folder.write("a.gltf", R"({"asset": {"version": "2.0"}, "scene": 0,
    "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0}], "images": [{"uri": "textures/wood.png"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                   "min": [0, 0, 0], "max": [0, 0, 0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"uri": "points.bin", "byteLength": 36}]})");
  CHECK(names(gltf) == std::vector<std::string>{"a.gltf", "points.bin", "wood.png"});
  CHECK_THROWS_WITH(AssimpLoader({}, host).files(folder.write("noise.obj", "x\n")),
                    ContainsSubstring("noise.obj: assimp cannot read it: "));
}

TEST_CASE("equal meshes are one", "[loader_assimp]") {
  const TemporaryFolder folder;
  const LoadedFile loaded(
      folder.write("a.obj", kTriangle + "o A\nf 1/1 2/2 3/3\nv 0 0 0\nv 1 0 0\nv 0 1 0\no B\n"
                                        "f 4/1 5/2 6/3\n"));
  CHECK(loaded.node("A").mesh == loaded.node("B").mesh);
}

TEST_CASE("a texture that is no picture is reported with the reason", "[loader_assimp]") {
  const TemporaryFolder folder;
  folder.write("wood.png", "no picture");
  folder.write("a.mtl", "newmtl A\nmap_Kd wood.png\n");
  const std::string file =
      folder.write("a.obj", "mtllib a.mtl\n" + kTriangle + "usemtl A\nf 1/1 2/2 3/3\n");
  const LoadedFile loaded(file);
  REQUIRE(loaded.host.messages.size() == 1);
  CHECK(loaded.host.messages[0].starts_with(file + ": texture @wood.png@ could not be read: "));
}

TEST_CASE("what assimp misses and survives is a warning", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("a.obj", "mtllib gone.mtl\n" + kTriangle + "f 1 2 3\n");
  const LoadedFile loaded(file);
  REQUIRE_FALSE(loaded.host.messages.empty());
  CHECK(loaded.host.messages[0].starts_with(file + ": assimp: "));
  CHECK(loaded.host.messages[0].find("gone.mtl") != std::string::npos);
}

TEST_CASE("a broken file is an asset error that begins with its name", "[loader_assimp]") {
  const TemporaryFolder folder;
  const auto check = [&](const std::string& name, const std::string& content) {
    const std::string file = folder.write(name, content);
    INFO(name);
    try {
      LoadedFile{file};
      FAIL("it was read");
    } catch (const Error& error) {
      CHECK(error.kind() == ErrorKind::Asset);
      CHECK(std::string(error.what()).starts_with(file + ": assimp cannot read it: "));
    }
  };
  check("noise.obj", "this is not what the ending says\n");
  check("empty.glb", "");
  check("empty.obj", "");
  check("noise.fbx", std::string(3000, 'x'));
  check("cut.gltf", R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [)");
  check("cut.dae", "<?xml version=\"1.0\"?><COLLADA version=\"1.4.1\"><asset>");
  REQUIRE(mkfifo(folder.path("pipe.obj").c_str(), 0600) == 0);
  CHECK_THROWS_WITH(LoadedFile{folder.path("pipe.obj")},
                    ContainsSubstring("pipe.obj: assimp cannot read it: it is not a regular file"));
  check("cut.glb", std::string("glTF\2\0\0\0\xff\xff\xff\x7f", 12));
}

}  // namespace diorama::loader_assimp
