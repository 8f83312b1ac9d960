// SPDX-License-Identifier: Apache-2.0
// Scenes that were saved on other machines name servers and disks that are not here.
#include <algorithm>
#include <filesystem>
#include <string>

#include "framework/host/asset_paths.h"
#include "loader_usd/usd_loader.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "support/texture_host.h"

namespace diorama::loader_usd {
namespace {

using test::TemporaryFolder;

/// An assets root with a prop that has a part and a picture beside it, and scenes elsewhere.
struct Disk {
  TemporaryFolder root;
  TemporaryFolder elsewhere;
  test::TextureHost host;
  Scene scene;

  explicit Disk(std::vector<AssetPrefix> prefixes = {}) {
    root.write("Isaac/Props/cup.usda", R"(#usda 1.0
(
    defaultPrim = "Cup"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Cup" (
    references = @./parts/handle.usda@
)
{
}
)");
    root.write("Isaac/Props/parts/handle.usda", R"(#usda 1.0
(
    defaultPrim = "Handle"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Handle"
{
    def Cube "Ring"
    {
        double size = 0.5
    }
}
)");
    host.find = [paths = AssetPaths(root.path(""), std::move(prefixes))](std::string_view asset) {
      return paths.resolve(asset);
    };
  }
  std::string scene_with(const std::string& prims) const {
    return elsewhere.write("scene.usda",
                           "#usda 1.0\n(\n    defaultPrim = \"Root\"\n    metersPerUnit = 1\n"
                           "    upAxis = \"Z\"\n)\ndef Xform \"Root\"\n{\n" +
                               prims + "}\n");
  }
  /// One prim per name that refers to it.
  std::string scene_of(const std::vector<std::string>& names) const {
    std::string prims;
    for (std::size_t i = 0; i < names.size(); ++i) {
      prims += "    def \"P" + std::to_string(i) + "\" ( references = @" + names[i] +
               "@ )\n    {\n    }\n";
    }
    return scene_with(prims);
  }
  void load(const std::string& file) {
    UsdLoader({}, host).load(file, scene, scene.create(scene.root(), "asset"));
  }
};

}  // namespace

TEST_CASE("what servers and other disks have is found below the assets root", "[loader_usd]") {
  Disk disk(std::vector<AssetPrefix>{{"omniverse://nucleus/Mine/", "Isaac/Props"}});
  const std::vector<std::string> names{
      "omniverse://localhost/NVIDIA/Assets/Isaac/4.2/Isaac/Props/cup.usda",
      "https://content.example.com/Assets/Isaac/2023.1.1/Isaac/Props/cup.usda",
      "Isaac/Props/cup.usda",
      "/Isaac/Props/cup.usda",
      "/home/somebody/Isaac/Props/cup.usda",
      "C:/Users/somebody/Isaac/Props/cup.usda",
      "omniverse://nucleus/Mine/cup.usda",
      "omniverse://server/Isaac/Props/cup.usda?version=12"};
  disk.load(disk.scene_of(names));
  CHECK(disk.host.warnings.empty());
  for (std::size_t i = 0; i < names.size(); ++i) {
    CAPTURE(names[i]);
    const NodeId ring = disk.scene.find("/asset/Root/P" + std::to_string(i) + "/Ring");
    REQUIRE(ring);
    CHECK(disk.scene[ring].mesh);
  }
  // The files of the scene are these, too, so that a dataset names them.
  const auto files = UsdLoader({}, disk.host).files(disk.elsewhere.path("scene.usda"));
  REQUIRE(files.size() == 3);
  CHECK(std::ranges::find(files, std::filesystem::path(disk.root.path("Isaac/Props/cup.usda"))) !=
        files.end());
}

TEST_CASE("what lies beside a layer comes before the assets root, and stays there if it says so",
          "[loader_usd]") {
  Disk disk;
  disk.elsewhere.write("Isaac/Props/cup.usda",
                       "#usda 1.0\n(\n    defaultPrim = \"Own\"\n)\ndef Xform \"Own\"\n{\n"
                       "    def Cube \"Mine\"\n    {\n    }\n}\n");
  // The last one is there, if it is taken for an absolute path.
  const std::string bare = disk.elsewhere.write("plain.usda", "#usda 1.0\n").substr(1);
  disk.load(disk.scene_of({"Isaac/Props/cup.usda", "./Isaac/Props/parts/handle.usda", bare}));
  CHECK(disk.scene.find("/asset/Root/P0/Mine"));
  CHECK_FALSE(disk.scene.find("/asset/Root/P1/Ring"));
  REQUIRE(disk.host.warnings.size() == 2);
  CHECK(disk.host.warnings[0].ends_with(
      "scene.usda: </Root/P1> reference @./Isaac/Props/parts/handle.usda@ could not be found"));
  CHECK(disk.host.warnings[1].ends_with("@" + bare + "@ could not be found"));
}

TEST_CASE("an asset that is nowhere is one warning that says where it would be looked for",
          "[loader_usd]") {
  Disk disk;
  const std::string gone = "omniverse://server/Isaac/Props/gone.usda";
  disk.load(disk.scene_of({gone, gone, gone, "beside.usda"}));
  REQUIRE(disk.host.warnings.size() == 2);
  CHECK(
      disk.host.warnings[0] ==
      disk.elsewhere.path("scene.usda") + ": </Root/P0> reference @" + gone +
          "@ could not be found: remote assets are not fetched; copy the file below the assets "
          "root (--assets-root, DIORAMA_ASSETS_ROOT) and name it '/Isaac/Props/gone.usda'; tried " +
          disk.root.path("Isaac/Props/gone.usda") + " (and 2 more references to it)");
  CHECK(disk.host.warnings[1].ends_with("@beside.usda@ could not be found"));
}

TEST_CASE("scenes that lack the same asset say so once", "[loader_usd]") {
  Disk disk;
  const std::string gone = "omniverse://server/Isaac/Props/gone.usda";
  const std::string picture = R"(
    def Cube "C" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </Root/Mat>
    }
    def Material "Mat"
    {
        token outputs:surface.connect = </Root/Mat/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </Root/Mat/T.outputs:rgb>
            token outputs:surface
        }
        def Shader "T"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @https://host/NVIDIA/Materials/gone.png@
            float3 outputs:rgb
        }
    }
)";
  const std::string part = "    def \"P\" ( references = @" + gone + "@ )\n    {\n    }\n";
  const std::string first = disk.elsewhere.write(
      "first.usda", "#usda 1.0\n(\n    defaultPrim = \"Root\"\n)\ndef Xform \"Root\"\n{\n" + part +
                        picture + "}\n");
  const std::string second = disk.elsewhere.write(
      "second.usda", "#usda 1.0\n(\n    defaultPrim = \"Root\"\n)\ndef Xform \"Root\"\n{\n" + part +
                         part.substr(0, 9) + "Q" + part.substr(10) + picture + "}\n");
  UsdLoader loader({}, disk.host);
  for (const std::string& file : {first, second, first}) {
    loader.load(file, disk.scene, disk.scene.create(disk.scene.root(), "asset"));
  }
  REQUIRE(disk.host.warnings.size() == 2);
  CHECK_THAT(disk.host.warnings[0] + disk.host.warnings[1],
             ContainsSubstring("gone.usda") && ContainsSubstring("gone.png"));
}

TEST_CASE("pictures and sets of tiles of servers are found, too", "[loader_usd]") {
  Disk disk;
  for (const char* tile : {"1001", "1002"}) {
    disk.root.write(std::string("NVIDIA/Materials/wood.") + tile + ".png", "x");
  }
  disk.root.write("NVIDIA/Materials/rough.png", "x");
  disk.load(disk.scene_with(R"(
    def Cube "C" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </Root/Mat>
    }
    def Material "Mat"
    {
        token outputs:surface.connect = </Root/Mat/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </Root/Mat/T.outputs:rgb>
            float inputs:roughness.connect = </Root/Mat/R.outputs:r>
            token outputs:surface
        }
        def Shader "T"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @https://host/NVIDIA/Materials/wood.<UDIM>.png@
            float3 outputs:rgb
        }
        def Shader "R"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @omniverse://host/NVIDIA/Materials/rough.png@
            float outputs:r
        }
    }
)"));
  CHECK(disk.host.warnings.empty());
  const Material& material = *disk.scene[disk.scene.require("/asset/Root/C")].materials.at(0);
  CHECK(material.base_color_texture);
  CHECK(material.roughness_texture);
  CHECK(disk.host.decoded.size() == 3);
}

}  // namespace diorama::loader_usd
