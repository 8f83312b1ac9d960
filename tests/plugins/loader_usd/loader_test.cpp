// SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "diorama/error.h"
#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {
namespace {

using diorama::test::TemporaryFolder;
using Loaded = diorama::test::LoadedStage;

const std::string kTriangle = R"(
        point3f[] points = [(0, 0, 0), (2, 0, 0), (0, 0, -4)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        uniform token subdivisionScheme = "none"
)";

}  // namespace

TEST_CASE("units and axes become metres and z up", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Xform "A"
{
    double3 xformOp:translate = (100, 200, 300)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "M"
    {)" + kTriangle + R"(
    }
}
)"));
  const Aabb bounds = loaded.scene.world_bounds(loaded.root);
  // y up (x, y, z) is z up (x, -z, y).
  CHECK(bounds.min.isApprox(Vec3(1.0, -3.0, 2.0), 1e-6));
  CHECK(bounds.max.isApprox(Vec3(1.02, -2.96, 2.0), 1e-6));
}

TEST_CASE("an asset's files are its layers and what their attributes name", "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("parts/handle.usda", "#usda 1.0\n(\n    subLayers = [@../look.usda@]\n)\n");
  folder.write("look.usda", R"(#usda 1.0
def Shader "S"
{
    asset inputs:file = @tiles.<UDIM>.png@
    asset inputs:missing = @missing.png@
}
)");
  folder.write("tiles.1001.png", "a");
  folder.write("tiles.1013.png", "a");
  folder.write("unused.png", "b");
  folder.write("red.usda", "#usda 1.0\n");
  const std::string file = folder.write("mug.usda", R"(#usda 1.0
def Xform "Mug" (
    payload = @./parts/handle.usda@
    variantSets = "color"
    variants = { string color = "blue" }
)
{
    variantSet "color" = {
        "blue" { }
        "red" (
            prepend references = @red.usda@
        ) { }
    }
}
)");
  test::TextureHost host;
  std::vector<std::string> names;
  for (const auto& path : UsdLoader({}, host).files(file)) names.push_back(path.filename());
  CHECK(names.front() == "mug.usda");
  std::sort(names.begin(), names.end());
  CHECK(names == std::vector<std::string>{"handle.usda", "look.usda", "mug.usda", "red.usda",
                                          "tiles.1001.png", "tiles.1013.png"});
  CHECK_THROWS_WITH(UsdLoader({}, host).files(folder.write("bad.usd", "x")),
                    ContainsSubstring("bad.usd"));
}

TEST_CASE("a referenced asset with other units is scaled to fit", "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("part.usda", R"(#usda 1.0
(
    defaultPrim = "Part"
    metersPerUnit = 0.01
    upAxis = "Z"
)
def Xform "Part"
{
    def Mesh "M"
    {)" + kTriangle + R"(
    }
}
)");
  Loaded loaded(folder.write("room.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Chair" (
    references = @part.usda@
)
{
    double3 xformOp:translate = (5, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
)"));
  const Aabb bounds = loaded.scene.world_bounds(loaded.root);
  CHECK(bounds.min.isApprox(Vec3(5.0, 0.0, -0.04), 1e-6));
  CHECK(bounds.max.isApprox(Vec3(5.02, 0.0, 0.0), 1e-6));

  Loaded by_hand(folder.write("by_hand.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Chair" (
    references = @part.usda@
)
{
    double3 xformOp:scale = (0.01, 0.01, 0.01)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}
)"));
  CHECK(by_hand.scene.world_bounds(by_hand.root).size().isApprox(Vec3(0.02, 0.0, 0.04), 1e-6));
}

TEST_CASE("faces are triangulated, split by corners, oriented and assigned to subsets",
          "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Mesh "M"
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)]
    int[] faceVertexCounts = [4, 4, 3, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2, 0, 1, 99, 0, 1, 2, 3]
    int[] holeIndices = [3]
    uniform token orientation = "leftHanded"
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0), (1, 0), (1, 1), (0, 1), (0, 0), (0, 0), (0, 0), (0, 0), (0, 0), (0, 0), (0, 0)] (
        interpolation = "faceVarying"
    )
    rel material:binding = </Red>
    def GeomSubset "Second"
    {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </Blue>
    }
}
def Material "Red"
{
    token outputs:surface.connect = </Red/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        float inputs:roughness = 0.25
        token outputs:surface
    }
}
def Material "Blue"
{
    token outputs:surface.connect = </Blue/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity = 0
        float inputs:ior = 1.4
        token outputs:surface
    }
}
)"));
  const Node& node = loaded.node("M");
  REQUIRE(node.mesh);
  const Mesh& mesh = *node.mesh;
  // Two quads; the face with the bad index and the hole are left out.
  REQUIRE(mesh.triangles.size() == 4);
  CHECK(mesh.material_slots == std::vector<std::uint16_t>{0, 0, 1, 1});
  // The point (1, 0, 0) has two places in the texture, (1, 1, 0) too.
  CHECK(mesh.positions.size() == 8);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3f normal =
        (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    CHECK(normal.z() < 0.0f);
  }
  REQUIRE(node.materials.size() == 2);
  CHECK(node.materials[0]->base_color == Vec3f(1, 0, 0));
  CHECK(node.materials[0]->roughness == 0.25f);
  CHECK(node.materials[1]->transmission == 1.0f);
  CHECK(node.materials[1]->ior == 1.4f);
}

TEST_CASE("textures keep layout and colour space; a missing one is named with its layer",
          "[loader_usd]") {
  const TemporaryFolder folder;
  folder.write("tex/wood.png", "x");
  const std::string text = R"(#usda 1.0
def Cube "C"
{
    rel material:binding = </Mat>
}
def Material "Mat"
{
    asset inputs:picture = @tex/wood.png@
    token outputs:surface.connect = </Mat/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
        float inputs:roughness.connect = </Mat/R.outputs:g>
        token outputs:surface
    }
    def Shader "T"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file.connect = </Mat.inputs:picture>
        token inputs:wrapS = "mirror"
        float4 inputs:scale = (0.5, 0.5, 0.5, 1)
        float2 inputs:st.connect = </Mat/X.outputs:result>
        float3 outputs:rgb
    }
    def Shader "X"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:scale = (2, 3)
        float2 inputs:translation = (0.25, 0)
        float2 inputs:in.connect = </Mat/V.outputs:result>
    }
    def Shader "V"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
    }
    def Shader "R"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @tex/rough.png@
        float outputs:g
    }
}
)";
  const std::string file = folder.write("a.usda", text);
  Loaded loaded(file);
  const Material& material = *loaded.node("C").materials.at(0);
  REQUIRE(material.base_color_texture);
  CHECK(material.base_color_texture.wrap_u == Wrap::Mirror);
  CHECK(material.base_color_texture.wrap_v == Wrap::Repeat);
  CHECK(material.base_color_texture.scale[0] == 0.5f);
  CHECK(material.base_color_texture.texture->color_space == ColorSpace::Srgb);
  const Vec2f mapped = material.base_color_texture.uv_from_mesh_uv * Vec3f(1, 1, 1);
  CHECK(mapped.isApprox(Vec2f(2.25f, 3.0f)));
  CHECK_FALSE(material.roughness_texture);
  REQUIRE(loaded.host.warnings.size() == 1);
  const std::string missing =
      file + ": texture @tex/rough.png@ could not be found (material 'Mat')";
  CHECK(loaded.host.warnings[0] == missing);

  UsdLoader::Params strict;
  strict.missing_assets_are_errors = true;
  CHECK_THROWS_WITH(Loaded(file, strict), file + ": " + missing);
}

TEST_CASE("prims that are keypoints name their nodes", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Z"
)
def Xform "Pen"
{
    def Xform "Tip"
    {
        custom string diorama:keypoint = "tip"
        double3 xformOp:translate = (10, 0, 2)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "Other"
    {
        custom token diorama:keypoint = "end"
    }
}
)"));
  const Node& tip = loaded.node("Pen/Tip");
  REQUIRE(tip.keypoints.size() == 1);
  CHECK(tip.keypoints[0].name == "tip");
  const Vec3 place = loaded.scene.world_from_node(loaded.scene.require("/asset/Pen/Tip")) *
                     tip.keypoints[0].position;
  CHECK((place - Vec3(0.1, 0, 0.02)).norm() < 1e-12);
  CHECK(loaded.node("Pen/Other").keypoints.at(0).name == "end");
  CHECK(loaded.node("Pen").keypoints.empty());
}

TEST_CASE("instances and instancers share meshes", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
class Xform "Class"
{
    def Mesh "M"
    {)" + kTriangle + R"(
    }
}
def "One" (
    inherits = </Class>
    instanceable = true
)
{
}
def "Two" (
    inherits = </Class>
    instanceable = true
)
{
}
def PointInstancer "Many"
{
    rel prototypes = </Many/Proto>
    int[] protoIndices = [0, 0, 0]
    int64[] invisibleIds = [1]
    point3f[] positions = [(0, 0, 0), (5, 0, 0), (0, 7, 0)]
    quath[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0), (0.7071, 0, 0, 0.7071)]
    float3[] scales = [(1, 1, 1), (1, 1, 1), (2, 2, 2)]
    def Cube "Proto"
    {
        double size = 1
    }
}
)"));
  CHECK(loaded.node("One/M").mesh == loaded.node("Two/M").mesh);
  const NodeId many = loaded.scene.require("/asset/Many");
  const auto& children = loaded.scene[many].children;
  REQUIRE(children.size() == 2);
  CHECK(loaded.scene[children[0]].mesh == loaded.scene[children[1]].mesh);
  const Affine pose = loaded.scene.world_from_node(children[1]);
  CHECK((pose * Vec3(1, 0, 0)).isApprox(Vec3(0, 9, 0), 1e-3));
}

TEST_CASE("prototypes may stand below overs, which are not drawn by themselves", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
def PointInstancer "Many"
{
    rel prototypes = </Protos/P>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (5, 0, 0)]
}
over "Protos"
{
    def Xform "P"
    {
        def Cube "C"
        {
        }
        class "Model"
        {
            def Cube "Hidden"
            {
            }
        }
        def Cube "Off" (
            active = false
        )
        {
        }
    }
}
)"));
  CHECK(loaded.node("Many/P/C").mesh);
  CHECK(loaded.node("Many/P_01/C").mesh == loaded.node("Many/P/C").mesh);
  CHECK(loaded.scene.subtree(loaded.root).size() == 6);
}

TEST_CASE("only subsets of the family of materials get slots", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
def Material "Red"
{
    token outputs:surface.connect = </Red/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
def Mesh "M"
{)" + kTriangle + R"(
    def GeomSubset "Grip"
    {
        uniform token familyName = "grasp"
        int[] indices = [0]
        rel material:binding = </Red>
    }
    def GeomSubset "Bound"
    {
        uniform token familyName = "materialBind"
        int[] indices = [0]
        rel material:binding = </Red>
    }
}
)"));
  CHECK(loaded.node("M").materials.size() == 2);
}

TEST_CASE("meshes that are written twice are one", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string other = R"(
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0.5)])";
  Loaded loaded(folder.write("a.usda", "#usda 1.0\ndef Mesh \"A\"\n{" + kTriangle +
                                           "\n}\ndef Mesh \"B\"\n{" + kTriangle +
                                           "\n}\ndef Mesh \"C\"\n{" + other + "\n}\n"));
  CHECK(loaded.node("A").mesh == loaded.node("B").mesh);
  CHECK(loaded.node("A").mesh != loaded.node("C").mesh);
}

TEST_CASE("what is not drawn is said once per type, with the first prim", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("a.usda", R"(#usda 1.0
def Xform "Plant"
{
    def NurbsCurves "Hidden"
    {
        token visibility = "invisible"
    }
    def NurbsCurves "Stem"
    {
    }
    def NurbsCurves "Leaf"
    {
    }
    def TetMesh "Guide"
    {
        token purpose = "guide"
    }
}
def TetMesh "Pollen"
{
}
)");
  Loaded loaded(file);
  CHECK(
      loaded.host.warnings ==
      std::vector<std::string>{
          file + ": </Plant/Stem> is of type NurbsCurves, which is not drawn, like 1 more of them",
          file + ": </Pollen> is of type TetMesh, which is not drawn"});
}

TEST_CASE("a camera's film may be moved beside its axis", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
def Camera "C"
{
    float horizontalAperture = 20
    float verticalAperture = 10
    float horizontalApertureOffset = 5
    float verticalApertureOffset = -2
}
def Camera "Flat"
{
    token projection = "orthographic"
}
)"));
  const Camera& camera = *loaded.node("C").camera;
  // The film reaches from -5 to 15 across, and from -7 to 3 upwards.
  CHECK(camera.cx == Approx(camera.width * 5.0 / 20.0));
  CHECK(camera.cy == Approx(camera.height * 3.0 / 10.0));
  REQUIRE(loaded.host.warnings.size() == 1);
  CHECK(loaded.host.warnings[0].ends_with(
      "a.usda: </Flat> is an orthographic camera, which is taken as a perspective one"));
}

TEST_CASE("lights, bodies, colliders, labels and visibility arrive", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Body" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI", "SemanticsLabelsAPI:class"]
)
{
    float physics:mass = 2.5
    token[] semantics:labels:class = ["banana"]
    def Capsule "Shape" (
        prepend apiSchemas = ["PhysicsCollisionAPI"]
    )
    {
        double radius = 0.25
        double height = 1.5
    }
    def Cube "Guide"
    {
        uniform token purpose = "guide"
    }
}
def Xform "Old"
{
    token semantic:Semantics:params:semanticType = "class"
    string semantic:Semantics:params:semanticData = "cup"
    token visibility = "invisible"
}
def SphereLight "Lamp"
{
    float inputs:intensity = 100
    float inputs:exposure = 1
    bool inputs:normalize = 1
    float inputs:radius = 0.5
}
)"));
  CHECK(loaded.node("Body").rigid_body->mass_kg == 2.5);
  CHECK(loaded.node("Body").labels.at("class") == "banana");
  CHECK(loaded.node("Old").labels.at("class") == "cup");
  CHECK_FALSE(loaded.node("Old").is_visible);
  CHECK_FALSE(loaded.node("Body/Guide").is_visible);
  const Collider& collider = *loaded.node("Body/Shape").collider;
  CHECK(collider.shape == ColliderShape::Primitive);
  CHECK(collider.primitive == PrimitiveShape::Capsule);
  CHECK(collider.primitive_size.isApprox(Vec3(0.5, 0.5, 2.0), 1e-3));
  // 100 * 2^1 over the sphere's area.
  CHECK(loaded.node("Lamp").light->color.x() == Approx(200.0 / kPi));
}

TEST_CASE("several labels of one type are joined by commas", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
def Xform "New"
{
    token[] semantics:labels:class = ["chair", "", "seat", "chair"]
    token[] semantics:labels:none = []
}
def Xform "Old"
{
    string semantic:A:params:semanticType = "class"
    string semantic:A:params:semanticData = "cup"
    string semantic:B:params:semanticType = "class"
    string semantic:B:params:semanticData = "mug"
}
)"));
  CHECK(loaded.node("New").labels == Labels{{"class", "chair,seat"}});
  CHECK(loaded.node("Old").labels == Labels{{"class", "cup,mug"}});
}

TEST_CASE("broken numbers, lists and prototypes are left out", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded(folder.write("a.usda", R"(#usda 1.0
def Mesh "Negative"
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3, -1, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 1, 2]
}
def Mesh "Halves"
{
    point3h[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    int[] holeIndices = [5, -1]
    normal3h[] normals = [(0, 0, 1)] ( interpolation = "banana" )
    texCoord2f[] primvars:st = [(nan, 0), (inf, 0), (0.5, 1)] ( interpolation = "vertex" )
}
def PointInstancer "Instancer"
{
    rel prototypes = [</Protos/A>, </Protos/Off>, </Protos/Gone>]
    int[] protoIndices = [0, 1, 2, 0, 9, -1]
    point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (4, 0, 0)]
    int64[] ids = [10, 11, 12, 13, 14, 15]
    int64[] invisibleIds = [13]
    quatf[] orientationsf = [(1, 0, 0, 0)]
    float3[] scales = []
}
def Camera "Camera"
{
    float horizontalAperture = 0
    float verticalAperture = inf
    float focalLength = -3
    float2 clippingRange = (nan, -1)
    float fStop = nan
}
def SphereLight "Lamp"
{
    float inputs:radius = 0
    float inputs:intensity = -5
}
class "Protos"
{
    def Cube "A"
    {
    }
    def Cube "Off" (
        active = false
    )
    {
    }
}
)"));
  CHECK(loaded.node("Negative").mesh->triangles.size() == 1);
  const Mesh& halves = *loaded.node("Halves").mesh;
  halves.validate("halves");
  CHECK(halves.normals.at(0) == Vec3f::UnitZ());
  CHECK(halves.uvs.at(0) == Vec2f::Zero());
  CHECK(halves.uvs.at(2) == Vec2f(0.5f, 1));
  CHECK(loaded.node("Instancer").children.size() == 1);
  const Camera& camera = *loaded.node("Camera").camera;
  CHECK(std::isfinite(camera.fx));
  CHECK(camera.near_m > 0.0);
  CHECK(camera.far_m > camera.near_m);
  CHECK(camera.f_stop == 0.0);
  CHECK(loaded.node("Lamp").light->color == Vec3f::Zero());
  CHECK(loaded.node("Lamp").light->radius_m > 0.0);
}

TEST_CASE("a broken file is an asset error that begins with its name", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("a.usda", "#usda 1.0\ndef \"A\" {\n");
  CHECK_THROWS_AS(Loaded(file), Error);
  CHECK_THROWS_WITH(Loaded(file), file +
                                      ":3:1: expected '}' after the contents of a prim, "
                                      "found the end of the file");
  const std::string empty = folder.write("b.usdc", "");
  CHECK_THROWS_WITH(Loaded(empty),
                    empty +
                        ": this is neither a crate, nor a package, nor a text layer at byte "
                        "offset 0");
  const std::string pipe = folder.path("pipe.usd");
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(Loaded(pipe), pipe + ": is not a regular file");
}

}  // namespace diorama::loader_usd
