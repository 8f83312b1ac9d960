// SPDX-License-Identifier: Apache-2.0
//
// What a file says and the scene does not get is said once per file and fault.
#include <algorithm>
#include <string>
#include <vector>

#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {
namespace {

using diorama::test::TemporaryFolder;
using Loaded = diorama::test::LoadedStage;

const std::string kMetres = "#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n";

Loaded load(const TemporaryFolder& folder, const std::string& body) {
  return Loaded(folder.write("a.usda", kMetres + body));
}

// The warnings without the name of the file.
std::vector<std::string> warnings_of(const Loaded& loaded) {
  std::vector<std::string> result;
  for (const std::string& warning : loaded.host.warnings) {
    result.push_back(warning.substr(warning.find("a.usda: ") + 8));
  }
  return result;
}

using Warnings = std::vector<std::string>;

std::string mesh(const std::string& name, const std::string& points, const std::string& counts,
                 const std::string& indices, const std::string& more = {}) {
  return "def Mesh \"" + name + "\"\n{\n    point3f[] points = " + points +
         "\n    int[] faceVertexCounts = " + counts + "\n    int[] faceVertexIndices = " + indices +
         "\n    uniform token subdivisionScheme = \"none\"\n" + more + "}\n";
}

const std::string kPoints = "[(0, 0, 0), (2, 0, 0), (0, 3, 0), (0, 0, 4)]";

}  // namespace

TEST_CASE("faces that cannot be drawn are missed", "[loader_usd]") {
  const TemporaryFolder folder;
  const Loaded sound = load(folder, mesh("M", kPoints, "[3, 3]", "[0, 1, 2, 0, 2, 3]"));
  CHECK(sound.host.warnings.empty());

  const Loaded range = load(folder, mesh("M", kPoints, "[3, 3]", "[0, 1, 2, 0, 2, 9]") +
                                        mesh("N", kPoints, "[3, 3]", "[0, 1, 2, -1, 2, 3]"));
  CHECK(warnings_of(range) ==
        Warnings{"</M> has faces with points that do not exist, which are left out, like 1 more of "
                 "them"});

  const Loaded nan = load(folder, mesh("M", "[(0, 0, 0), (2, 0, 0), (0, 3, 0), (0, nan, 4)]",
                                       "[3, 3]", "[0, 1, 2, 0, 2, 3]"));
  CHECK(warnings_of(nan) ==
        Warnings{"</M> has faces with points that are not finite, which are left out"});

  const Loaded cut = load(folder, mesh("M", kPoints, "[3, 4]", "[0, 1, 2, 0, 2, 3]"));
  CHECK(warnings_of(cut) ==
        Warnings{"</M> has a face that reaches behind the indices, from which on faces are left "
                 "out"});

  const Loaded rest = load(folder, mesh("M", kPoints, "[3]", "[0, 1, 2, 0, 2, 3]"));
  CHECK(warnings_of(rest) == Warnings{"</M> has more indices than its faces have corners"});
}

TEST_CASE("a mesh with nothing left is missed, an empty one is not", "[loader_usd]") {
  const TemporaryFolder folder;
  const Loaded lost = load(folder, mesh("M", kPoints, "[3]", "[0, 1, 9]"));
  CHECK(warnings_of(lost) ==
        Warnings{"</M> has faces with points that do not exist, which are left out",
                 "</M> is of type Mesh without a face that can be drawn, which is not drawn"});
  CHECK_FALSE(lost.scene[lost.scene.require("/asset/M")].mesh);
  CHECK(load(folder, mesh("M", "[]", "[]", "[]")).host.warnings.empty());
  CHECK(load(folder, "def Mesh \"M\"\n{\n}\n").host.warnings.empty());
  const Loaded half =
      load(folder, "def Mesh \"M\"\n{\n    point3f[] points = " + kPoints + "\n}\n");
  CHECK(warnings_of(half).size() == 1);
}

TEST_CASE("wrong numbers of values are said, and such normals made anew", "[loader_usd]") {
  const TemporaryFolder folder;
  const auto with = [&](const std::string& more) {
    return load(folder, mesh("M", kPoints, "[3, 3]", "[0, 1, 2, 0, 2, 3]", more));
  };
  Loaded few = with("    normal3f[] normals = [(1, 0, 0), (1, 0, 0)]\n");
  CHECK(warnings_of(few) == Warnings{"</M> has fewer normals than their interpolation asks for"});
  // Those of the faces: the first one lies in the plane of x and y.
  const Mesh& made = *few.node("M").mesh;
  CHECK(made.normals.empty());
  const Loaded many =
      with("    normal3f[] normals = [(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)]\n");
  CHECK(warnings_of(many) ==
        Warnings{"</M> has more normals than their interpolation asks for, of which the first "
                 "ones count"});
  const Loaded sound =
      with("    normal3f[] normals = [(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)]\n");
  CHECK(sound.host.warnings.empty());
  const Loaded indices = with(
      "    texCoord2f[] primvars:st = [(0, 0), (1, 0)] (\n        interpolation = \"vertex\"\n"
      "    )\n    int[] primvars:st:indices = [0, 1, 2, 0]\n");
  CHECK(warnings_of(indices) == Warnings{"</M> has indices of uvs that do not exist"});
}

TEST_CASE("poses that cannot be had are missed", "[loader_usd]") {
  const TemporaryFolder folder;
  const Loaded nan = load(folder, R"(def Xform "A"
{
    double3 xformOp:translate = (nan, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
)");
  CHECK(warnings_of(nan) == Warnings{"</A> has a pose that is not finite; it stays where its "
                                     "parent is"});
  const Loaded lacking = load(folder, R"(def Xform "A"
{
    double3 xformOp:translate = (1, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
}
def Xform "B"
{
    string xformOp:scale = "big"
    uniform token[] xformOpOrder = ["xformOp:scale"]
}
def Xform "C"
{
    double3 xformOp:translate
    double3 xformOp:scale = None
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
)");
  CHECK(warnings_of(lacking) ==
        Warnings{"</A> has a transform that cannot be read (xformOp:scale), like 1 more of them"});
  CHECK(lacking.scene.world_from_node(lacking.scene.require("/asset/A"))
            .translation()
            .isApprox(Vec3(1, 0, 0)));
}

TEST_CASE("bindings that lead to no material are missed", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string triangle = "    rel material:binding = ";
  const Loaded nothing =
      load(folder, mesh("M", kPoints, "[3]", "[0, 1, 2]", triangle + "</Looks/Red>\n") +
                       mesh("N", kPoints, "[3]", "[0, 1, 2]", triangle + "</M>\n"));
  CHECK(warnings_of(nothing) ==
        Warnings{"</M> is bound to a material that is not there (</Looks/Red>), like 1 more of "
                 "them"});
  // A reference does not carry what is bound outside of its prim.
  folder.write("part.usda",
               kMetres + "def Xform \"P\"\n{\n" +
                   mesh("M", kPoints, "[3]", "[0, 1, 2]", triangle + "</Looks/Red>\n") +
                   "}\ndef Scope \"Looks\"\n{\n    def Material \"Red\"\n    {\n    }\n}\n");
  const Loaded outside = load(folder, "def \"A\" (\n    references = @part.usda@</P>\n)\n{\n}\n");
  CHECK(warnings_of(outside) ==
        Warnings{"</A/M> is bound to a material that is not there (</Looks/Red>)"});
  const Loaded none = load(folder, mesh("M", kPoints, "[3]", "[0, 1, 2]", triangle + "None\n"));
  CHECK(none.host.warnings.empty());
}

TEST_CASE("instances, points and curves that cannot be drawn are missed", "[loader_usd]") {
  const TemporaryFolder folder;
  const Loaded instancer = load(folder, R"(def PointInstancer "I"
{
    int[] protoIndices = [0, 5, 0]
    point3f[] positions = [(0, 0, 0), (1, 0, 0)]
    rel prototypes = </I/P>
    def Cube "P"
    {
    }
}
)");
  CHECK(warnings_of(instancer) == Warnings{"</I> has fewer positions than instances",
                                           "</I> has instances of prototypes that are not there"});
  const Loaded points = load(folder, R"(def Points "P"
{
    point3f[] points = [(0, 0, 0), (nan, 0, 0), (1, 1, 1)]
    float[] widths = [0.1, 0.1]
}
)");
  CHECK(warnings_of(points) ==
        Warnings{"</P> has fewer widths than points, of which the rest is left out",
                 "</P> has points that are not finite, which are left out"});
  const Loaded curves = load(folder, R"(def BasisCurves "C"
{
    uniform token type = "linear"
    int[] curveVertexCounts = [2, 2, 7]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (nan, 0, 0), (1, 1, 1)]
    float[] widths = [0.1] (
        interpolation = "constant"
    )
}
)");
  CHECK(warnings_of(curves) ==
        Warnings{"</C> has a curve that reaches behind the points, from which on curves are left "
                 "out",
                 "</C> has curves with points that are not finite, which are left out"});
}

TEST_CASE("units and axes that are none are said, and count as not said", "[loader_usd]") {
  const TemporaryFolder folder;
  const auto loaded_with = [&](const std::string& unit, const std::string& axis) {
    return Loaded(folder.write("a.usda", "#usda 1.0\n(\n    metersPerUnit = " + unit +
                                             "\n    upAxis = \"" + axis + "\"\n)\n" +
                                             mesh("M", kPoints, "[3]", "[0, 1, 2]")));
  };
  for (const std::string unit : {"0", "-1", "nan", "inf"}) {
    const Loaded loaded = loaded_with(unit, "Z");
    CHECK(warnings_of(loaded) == Warnings{"metersPerUnit is " + unit +
                                          ", expected a number above 0; it counts as not said, "
                                          "which is 0.01"});
    CHECK(loaded.scene.world_bounds(loaded.root).max.isApprox(Vec3(0.02, 0.03, 0), 1e-6));
  }
  for (const std::string axis : {"X", "z", "up", ""}) {
    const Loaded loaded = loaded_with("1", axis);
    CHECK(warnings_of(loaded) ==
          Warnings{"upAxis is '" + axis +
                   "', expected 'Y' or 'Z'; it counts as not said, which is 'Y'"});
    CHECK(loaded.scene.world_bounds(loaded.root).max.isApprox(Vec3(2, 0, 3), 1e-6));
  }
  // What a referenced file says wrongly does not scale it.
  folder.write("part.usda",
               "#usda 1.0\n(\n    metersPerUnit = inf\n    upAxis = \"X\"\n"
               "    defaultPrim = \"M\"\n)\n" +
                   mesh("M", kPoints, "[3]", "[0, 1, 2]"));
  const Loaded room = load(folder, "def \"A\" (\n    references = @part.usda@\n)\n{\n}\n");
  CHECK(room.host.warnings.size() == 2);
  CHECK(room.host.warnings.at(0).find("part.usda: metersPerUnit is inf") != std::string::npos);
  CHECK(room.scene.world_bounds(room.root).max.isApprox(Vec3(2, 3, 0), 1e-6));
}

TEST_CASE("old names of types lay textures out as new ones do", "[loader_usd]") {
  const TemporaryFolder folder;
  Loaded loaded =
      load(folder, mesh("M", kPoints, "[3]", "[0, 1, 2]",
                        "    Vec2f[] primvars:layout = [(0, 0), (0.5, 0), (0, 1), (0, 0)]"
                        " (\n        interpolation = \"vertex\"\n    )\n"));
  CHECK(loaded.node("M").mesh->uvs.size() == 3);
}

TEST_CASE("guides, proxies and hidden prims do not count in the bounds", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string far = "[(0, 0, 0), (200, 0, 0), (0, 300, 0), (0, 0, 400)]";
  const Loaded loaded = load(
      folder, mesh("M", kPoints, "[3]", "[0, 1, 2]") +
                  mesh("G", far, "[3]", "[0, 1, 2]", "    uniform token purpose = \"guide\"\n") +
                  mesh("P", far, "[3]", "[0, 1, 2]", "    uniform token purpose = \"proxy\"\n") +
                  mesh("H", far, "[3]", "[0, 1, 2]", "    token visibility = \"invisible\"\n"));
  CHECK(loaded.scene.world_bounds(loaded.root).max.isApprox(Vec3(2, 3, 0), 1e-6));
}

}  // namespace diorama::loader_usd
