// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {

using test::LoadedStage;
using test::TemporaryFolder;

namespace {

std::string stage(const std::string& body) {
  return "#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n" + body;
}

// Two squares that meet at a right angle, in points 1 and 2.
const std::string kFold = R"(
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 0, 1), (1, 1, 1)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
)";

}  // namespace

TEST_CASE("seams of uvs do not show in normals that are made", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string seam = R"(
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "faceVarying"
    )
)";
  LoadedStage loaded(folder.write("a.usda", stage("def Mesh \"M\"\n{" + kFold + seam + "}\n")));
  const Mesh& mesh = *loaded.node("M").mesh;
  REQUIRE(mesh.positions.size() == 8);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const bool is_at_fold = mesh.positions[i].x() == 1.0f && mesh.positions[i].z() == 0.0f;
    const bool is_flat = mesh.positions[i].x() == 0.0f;
    if (is_at_fold) CHECK(mesh.normals[i].isApprox(Vec3f(-1, 0, 1).normalized(), 1e-5f));
    if (is_flat) CHECK(mesh.normals[i].isApprox(Vec3f::UnitZ()));
  }
}

TEST_CASE("normals that are made turn with the orientation", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write(
      "a.usda",
      stage("def Mesh \"M\"\n{\n    uniform token orientation = \"leftHanded\"" + kFold + "}\n")));
  CHECK(loaded.node("M").mesh->normals.at(0).isApprox(-Vec3f::UnitZ()));
}

TEST_CASE("uvs may be of any type with two or three numbers", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string two = "[(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0), (0.5, 1)]";
  const std::string three =
      "[(0, 0, 9), (1, 0, 8), (1, 1, 7), (0, 1, 6), (0.5, 0, 5), (0.5, 1, 4)]";
  for (const char* type : {"texCoord2f", "texCoord2h", "texCoord2d", "float2", "half2", "double2",
                           "texCoord3f", "texCoord3h", "texCoord3d", "float3"}) {
    CAPTURE(type);
    const bool has_three = std::string(type).find('3') != std::string::npos;
    LoadedStage loaded(
        folder.write("a.usda", stage("def Mesh \"M\"\n{" + kFold + "    " + type +
                                     "[] primvars:st = " + (has_three ? three : two) +
                                     " (\n        interpolation = \"vertex\"\n    )\n}\n")));
    const Mesh& mesh = *loaded.node("M").mesh;
    REQUIRE(mesh.uvs.size() == 6);
    CHECK(mesh.uvs[2] == Vec2f(1, 1));
    CHECK(mesh.uvs[4] == Vec2f(0.5f, 0));
  }
}

TEST_CASE("instances that differ in the indices of a primvar have meshes of their own",
          "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", stage(R"(
class "Dots"
{
    def Points "P"
    {
        point3f[] points = [(0, 0, 0), (5, 0, 0)]
        float[] widths = [1, 1]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" )
        int[] primvars:displayColor:indices = [0, 1]
    }
}
def "A" ( inherits = </Dots> ) { }
def "B" ( inherits = </Dots> )
{
    over "P"
    {
        int[] primvars:displayColor:indices = [1, 0]
    }
}
)")));
  CHECK(loaded.node("A/P").mesh->colors.front() == Vec3f::UnitX());
  CHECK(loaded.node("B/P").mesh->colors.front() == Vec3f::UnitY());
}

TEST_CASE("a constant color may have an index, widths may be a primvar", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", stage("def Mesh \"M\"\n{" + kFold + R"(
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)]
    int[] primvars:displayColor:indices = [1]
}
def Points "P"
{
    point3f[] points = [(0, 0, 0)]
    float[] widths = [1]
    float[] primvars:widths = [4]
}
)")));
  CHECK(loaded.node("M").materials.at(0)->base_color == Vec3f::UnitZ());
  CHECK(loaded.node("P").mesh->bounds().max.z() == Approx(2.0).epsilon(0.05));
}

TEST_CASE("a shape beyond what a mesh can hold is none", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(
      folder.write("a.usda", stage("def Sphere \"S\"\n{\n    double radius = 1e300\n}\n")));
  CHECK_FALSE(loaded.node("S").mesh);
}

TEST_CASE("a blocked default gives way to the samples beside it", "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("weak.usda", stage("def Sphere \"Weak\"\n{\n    double radius = 3\n}\n"));
  LoadedStage loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
    subLayers = [@weak.usda@]
)
def Sphere "Sampled"
{
    double radius = None
    double radius.timeSamples = { 1: 2, 2: 5 }
}
def Sphere "Blocked"
{
    double radius.timeSamples = { 1: None, 2: 5 }
}
over "Weak"
{
    double radius = None
}
)"));
  const auto radius = [&](const char* name) { return loaded.node(name).mesh->bounds().max.z(); };
  CHECK(radius("Sampled") == Approx(2.0));
  // The fallback of the schema.
  CHECK(radius("Blocked") == Approx(1.0));
  CHECK(radius("Weak") == Approx(1.0));
}

}  // namespace diorama::loader_usd
