// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>
#include <vector>

#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {

using test::LoadedStage;
using test::TemporaryFolder;

namespace {

const std::string kHeader = R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
)";

const std::string kSquare = R"(
    point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
)";

const std::string kGlow = R"(
def Material "Glow"
{
    token outputs:surface.connect = </Glow/Surface.outputs:surface>
    def Shader "Surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (0, 0.5, 1)
        token outputs:surface
    }
}
)";

bool has_warning(const LoadedStage& loaded, const std::string& end) {
  const auto& warnings = loaded.host.warnings;
  return std::any_of(warnings.begin(), warnings.end(),
                     [&](const std::string& warning) { return warning.ends_with(end); });
}

}  // namespace

TEST_CASE("a mesh that is a light shines in its color", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", kHeader + R"(
def Mesh "Panel" ( prepend apiSchemas = ["MeshLightAPI"] )
{
    float inputs:intensity = 50
    float inputs:exposure = 1
    color3f inputs:color = (1, 0.5, 0)
)" + kSquare + R"(
}
def Mesh "Normalized" ( prepend apiSchemas = ["MeshLightAPI"] )
{
    float inputs:intensity = 50
    bool inputs:normalize = 1
    float3 xformOp:scale = (3, 3, 3)
    uniform token[] xformOpOrder = ["xformOp:scale"]
)" + kSquare + R"(
}
)"));
  const auto& panel = loaded.node("Panel").materials.at(0);
  CHECK(panel->emission.isApprox(Vec3f(100, 50, 0)));
  // A square of 2 by 2, three times as large.
  CHECK(loaded.node("Normalized").materials.at(0)->emission.x() == Approx(50.0 / 36.0));
}

TEST_CASE("a mesh light has to do with its material what its mode says", "[loader_usd]") {
  const TemporaryFolder folder;
  const auto emission = [&](const std::string& mode) {
    LoadedStage loaded(folder.write("a.usda", kHeader + kGlow + R"(
def Mesh "Panel" ( prepend apiSchemas = ["MeshLightAPI", "MaterialBindingAPI"] )
{
    rel material:binding = </Glow>
    float inputs:intensity = 10
)" + mode + kSquare + R"(
}
def Mesh "Same" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{
    rel material:binding = </Glow>
)" + kSquare + R"(
}
)"));
    CHECK(loaded.node("Same").materials.at(0)->emission.isApprox(Vec3f(0, 0.5f, 1)));
    return loaded.node("Panel").materials.at(0)->emission;
  };
  CHECK(emission("").isApprox(Vec3f(0, 5, 10)));
  CHECK(emission("    uniform token light:materialSyncMode = \"independent\"\n")
            .isApprox(Vec3f(10, 10, 10)));
  CHECK(emission("    uniform token light:materialSyncMode = \"noMaterialResponse\"\n")
            .isApprox(Vec3f(10, 10, 10)));
}

TEST_CASE("what a light says and a scene cannot hold is said once", "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("tv.png", "gray");
  LoadedStage loaded(folder.write("a.usda", kHeader + R"(
def RectLight "Screen"
{
    asset inputs:texture:file = @tv.png@
}
def SphereLight "A" ( prepend apiSchemas = ["ShapingAPI"] )
{
    float inputs:shaping:focus = 2
}
def SphereLight "B" ( prepend apiSchemas = ["ShapingAPI"] )
{
    float inputs:shaping:focus = 1
    asset inputs:shaping:ies:file = @lamp.ies@
}
def SphereLight "C"
{
    float inputs:diffuse = 0
    rel collection:lightLink:excludes = </A>
}
def Xform "Crowd" (
    clips = { dictionary default = { string primPath = "/A" } }
)
{
}
)"));
  CHECK(has_warning(loaded, "</Screen> is a light whose picture is taken as its mean color"));
  CHECK(has_warning(
      loaded, "</A> is a light whose inputs:shaping:focus is not taken, like 1 more of them"));
  CHECK(has_warning(loaded, "</B> is a light whose inputs:shaping:ies:file is not taken"));
  CHECK(has_warning(loaded, "</C> is a light whose inputs:diffuse is not taken"));
  CHECK(has_warning(loaded, "</C> is a light whose collection:lightLink:excludes is not taken"));
  CHECK(has_warning(loaded,
                    "the value clips 'default' of </Crowd> name no assets or no prim in "
                    "them, so they are not read"));
  CHECK(loaded.host.warnings.size() == 6);
}

TEST_CASE("the pole of a dome is up, unless it says otherwise", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", kHeader + R"(
def DomeLight "Old"
{
}
def DomeLight_1 "Scene"
{
}
def DomeLight_1 "Y"
{
    token poleAxis = "Y"
}
def DomeLight_1 "Z"
{
    token poleAxis = "Z"
}
)"));
  // The top of the picture is the node's +z.
  const auto pole = [&](const char* name) -> Vec3 {
    return loaded.node(name).parent_from_node.linear() * Vec3::UnitZ();
  };
  CHECK(pole("Old").isApprox(Vec3::UnitZ()));
  CHECK(pole("Scene").isApprox(Vec3::UnitZ()));
  CHECK(pole("Y").isApprox(Vec3::UnitY()));
  CHECK(pole("Z").isApprox(Vec3::UnitZ()));
}

}  // namespace diorama::loader_usd
