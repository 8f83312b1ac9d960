// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <string>

#include "loader_usd/usd/error.h"
#include "loader_usd/usd/extent.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/map_function.h"
#include "loader_usd/usd/stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::usd {
namespace {

using diorama::test::TemporaryFolder;

const std::string kHeader = "#usda 1.0\n";

double number(Stage& stage, const char* prim, const char* attribute = "x") {
  const Prim* found = stage.find(prim);
  REQUIRE(found);
  return stage.value(*found, attribute).as_number().value_or(-1.0);
}

Strings names(Stage& stage, const Prim& prim) {
  Strings result;
  for (const Prim* child : stage.visible_children(prim)) result.push_back(child->path);
  return result;
}

bool warns(const Stage& stage, const std::string& text) {
  for (const std::string& warning : stage.warnings()) {
    if (warning.find(text) != std::string::npos) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("quaternions of another length turn as OpenUSD turns them", "[composition]") {
  // Half numbers are not of unit length; the real part alone says how far.
  const Matrix half = rotation(std::array<double, 4>{0.0, 0.0, 0.70703125, 0.70703125});
  const double angle = 2.0 * std::acos(0.70703125);
  CHECK(half.at(0, 0) == Approx(std::cos(angle)).epsilon(1e-12).margin(1e-12));
  CHECK(half.at(0, 1) == Approx(std::sin(angle)).epsilon(1e-12));
  CHECK(rotation(std::array<double, 4>{0.0, 0.0, 0.0, 0.5}) == Matrix());
  CHECK(std::isnan(rotation(std::array<double, 4>{std::nan(""), 0.0, 0.0, 1.0}).at(0, 0)));
}

TEST_CASE("arcs are as strong as USD says", "[composition]") {
  const TemporaryFolder folder;
  // Each arc brings an x of its own; taking away the strongest one shows the next.
  std::string text = kHeader;
  text += R"(
class "Inh" { int x = 2 }
class "Spec" { int x = 6 }
def "Ref" { int x = 4 }
def "Pay" { int x = 5 }
def "P" (
    inherits = </Inh>
    specializes = </Spec>
    references = </Ref>
    payload = </Pay>
    variants = { string v = "a" }
    variantSets = "v"
)
{
    int x = 1
    variantSet "v" = {
        "a" {
            int x = 3
        }
    }
}
)";
  // One statement per line, as the format wants it.
  const auto spread = [](std::string body) {
    for (std::size_t at = 0; (at = body.find("{ int", at)) != std::string::npos;) {
      body.replace(at, 1, "{\n");
      const std::size_t close = body.find(" }", at);
      body.replace(close, 2, "\n}");
    }
    return body;
  };
  text = spread(text);
  for (int strongest = 1; strongest <= 6; ++strongest) {
    Stage stage(folder.write("s" + std::to_string(strongest) + ".usda", text));
    CHECK(number(stage, "/P") == strongest);
    const std::string line = "int x = " + std::to_string(strongest) + "\n";
    const std::size_t at = text.find(line);
    REQUIRE(at != std::string::npos);
    text.erase(at, line.size());
  }
}

TEST_CASE("a specialized class is weaker than what a reference brings", "[composition]") {
  const TemporaryFolder folder;
  folder.write("asset.usda", kHeader + R"(
def "Base"
{
    int x = 1
}
def "Model" (
    specializes = </Base>
)
{
}
)");
  Stage stage(folder.write("root.usda", kHeader + R"(
def "Base"
{
    int x = 3
}
def "Weak"
{
    int x = 2
}
def "P" (
    references = [@asset.usda@</Model>, </Weak>]
)
{
}
)"));
  CHECK(number(stage, "/P") == 2.0);
}

TEST_CASE("what a referenced prim inherits can be overridden from outside", "[composition]") {
  const TemporaryFolder folder;
  folder.write("asset.usda", kHeader + R"(
class "Class"
{
    int x = 1
}
def "Model" (
    inherits = </Class>
)
{
}
)");
  Stage stage(folder.write("root.usda", kHeader + R"(
class "Class"
{
    int x = 7
}
def "P" (
    references = @asset.usda@</Model>
)
{
}
)"));
  CHECK(number(stage, "/P") == 7.0);
}

TEST_CASE("list edits of several layers add up, children of weak layers come first",
          "[composition]") {
  const TemporaryFolder folder;
  folder.write("weak.usda", kHeader + R"(
def "P" (
    apiSchemas = ["A", "B", "C"]
)
{
    def "One"
    {
    }
    def "Two"
    {
    }
}
)");
  Stage stage(folder.write("root.usda", kHeader + R"(
(
    subLayers = [@./weak.usda@]
)
over "P" (
    prepend apiSchemas = ["X"]
    append apiSchemas = ["A"]
    delete apiSchemas = ["B"]
)
{
    def "Three"
    {
    }
    reorder nameChildren = ["Three", "Two"]
}
)"));
  const Prim& prim = *stage.find("/P");
  CHECK(stage.metadata_list(prim, "apiSchemas") == Strings{"X", "C", "A"});
  CHECK(names(stage, prim) == Strings{"/P/One", "/P/Three", "/P/Two"});
}

TEST_CASE("paths are mapped through references, those outside of the asset are lost",
          "[composition]") {
  const TemporaryFolder folder;
  folder.write("asset/model.usda", kHeader + R"(
(
    defaultPrim = "Model"
)
def "Model"
{
    rel inside = </Model/Part.x>
    rel outside = </Elsewhere>
    asset picture = @./wood.png@
}
)");
  Stage stage(folder.write("root.usda", kHeader + R"(
def "World"
{
    def "Chair" (
        references = @asset/model.usda@
    )
    {
    }
}
)"));
  const Prim& chair = *stage.find("/World/Chair");
  CHECK(stage.targets(chair, "inside") == Strings{"/World/Chair/Part.x"});
  CHECK(stage.targets(chair, "outside").empty());
  CHECK(stage.anchor(stage.find_value(chair, "picture")) == folder.path("asset/wood.png"));
}

TEST_CASE("a stronger layer selects the variant of a referenced asset", "[composition]") {
  const TemporaryFolder folder;
  folder.write("asset.usda", kHeader + R"(
def "Model" (
    variants = {
        string size = "small"
    }
    prepend variantSets = "size"
)
{
    variantSet "size" = {
        "small" {
            def "Small"
            {
            }
        }
        "big" {
            def "Big"
            {
            }
        }
    }
}
)");
  Stage stage(folder.write("root.usda", kHeader + R"(
def "P" (
    references = @asset.usda@</Model>
    variants = {
        string size = "big"
    }
)
{
}
)"));
  CHECK(names(stage, *stage.find("/P")) == Strings{"/P/Big"});
}

TEST_CASE("opinions below an instance do not count", "[composition]") {
  const TemporaryFolder folder;
  Stage stage(folder.write("root.usda", kHeader + R"(
class "Class"
{
    def "Child"
    {
        int x = 1
    }
}
def "Instance" (
    inherits = </Class>
    instanceable = true
)
{
    over "Child"
    {
        int x = 2
    }
    def "Extra"
    {
    }
}
)"));
  CHECK(stage.find("/Instance")->is_instance);
  CHECK(number(stage, "/Instance/Child") == 1.0);
  CHECK(stage.find("/Instance/Child")->is_instance_proxy);
  CHECK(stage.find("/Instance/Extra") == nullptr);
}

TEST_CASE("relocates move prims", "[composition]") {
  const TemporaryFolder folder;
  folder.write("asset.usda", kHeader + R"(
def "Model"
{
    def "Old"
    {
        int x = 5
    }
}
)");
  Stage stage(folder.write("root.usda", kHeader + R"(
(
    relocates = {
        </P/Old>: </P/New>
    }
)
def "P" (
    references = @asset.usda@</Model>
)
{
}
)"));
  CHECK(names(stage, *stage.find("/P")) == Strings{"/P/New"});
  CHECK(number(stage, "/P/New") == 5.0);
}

TEST_CASE("circles and missing assets are reported once, with asset and layer", "[composition]") {
  const TemporaryFolder folder;
  const std::string root = folder.write("root.usda", kHeader + R"(
(
    subLayers = [@gone.usda@, @root.usda@]
)
def "A" (
    references = </B>
)
{
}
def "B" (
    references = </A>
)
{
}
def "C" (
    references = [@nothing.usda@, @nothing.usda@</X>]
)
{
}
)");
  Stage stage(root);
  names(stage, stage.root());
  CHECK(warns(stage, "</C> reference @nothing.usda@ could not be found"));
  CHECK(warns(stage, root + ": sublayer @gone.usda@ could not be found"));
  CHECK(warns(stage, "sublayer @root.usda@ contains this layer itself"));
  CHECK(warns(stage, "leads back to itself"));
  CHECK(stage.diagnostics().missing_assets().size() == 2);
}

TEST_CASE("transforms follow the order of the ops, with inverses and reset", "[geometry]") {
  const TemporaryFolder folder;
  Stage stage(folder.write("root.usda", kHeader + R"(
def Xform "A"
{
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Xform "Pivoted"
    {
        double3 xformOp:translate = (0, 5, 0)
        float3 xformOp:translate:pivot = (1, 0, 0)
        float xformOp:rotateZ = 90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:pivot", "xformOp:rotateZ", "!invert!xformOp:translate:pivot"]
    }
    def Xform "Free"
    {
        float3 xformOp:scale = (2, 3, 4)
        uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:scale"]
    }
}
)"));
  Geometry geometry(stage);
  const Vector3 moved =
      transform(geometry.world_from_prim(*stage.find("/A/Pivoted")), Vector3{2, 0, 0});
  CHECK(moved[0] == Approx(11.0));
  CHECK(moved[1] == Approx(6.0));
  const Vector3 scaled =
      transform(geometry.world_from_prim(*stage.find("/A/Free")), Vector3{1, 1, 1});
  CHECK(scaled == Vector3{2, 3, 4});
}

TEST_CASE("ops may have any suffix, type and axis; words that are no ops do nothing",
          "[geometry]") {
  const TemporaryFolder folder;
  Stage stage(folder.write("root.usda", kHeader + R"(
def Xform "A"
{
    half3 xformOp:translate:a:b = (1, 2, 3)
    double xformOp:translateY:c = 10
    float xformOp:scaleZ = 2
    half xformOp:rotateX:tilt = 90
    quath xformOp:orient:turn = (1, 0, 0, 0)
    double xformOp:rotateA = 45
    double3 xformOp:rotateXXY = (10, 20, 30)
    double xformOp:translateZZ = 7
    double3 xformOp:shear = (1, 1, 1)
    double3[] xformOp:scale = [(2, 2, 2)]
    uniform token[] xformOpOrder = ["xformOp:translate:a:b", "xformOp:translateY:c", "xformOp:rotateX:tilt", "xformOp:scaleZ", "xformOp:orient:turn", "xformOp:rotateA", "xformOp:rotateXXY", "xformOp:translateZZ", "xformOp:shear", "xformOp:scale", "xformOp:missing", "nonsense"]
}
)"));
  Geometry geometry(stage);
  const Vector3 moved = transform(geometry.world_from_prim(*stage.find("/A")), Vector3{1, 0, 1});
  CHECK(moved[0] == Approx(2.0));
  CHECK(moved[1] == Approx(12.0 - 2.0));
  CHECK(moved[2] == Approx(3.0));
}

TEST_CASE("the nearest material counts unless an ancestor's is stronger", "[geometry]") {
  const TemporaryFolder folder;
  Stage stage(folder.write("root.usda", kHeader + R"(
def Material "Red"
{
}
def Material "Blue"
{
}
def Xform "A" (
    prepend apiSchemas = ["CollectionAPI:glass"]
)
{
    rel material:binding = </Red>
    rel material:binding:collection:glass = [</A.collection:glass>, </Blue>]
    rel collection:glass:includes = </A/Pane>
    def Cube "Own"
    {
        rel material:binding = </Blue>
    }
    def Cube "Plain"
    {
    }
    def Cube "Pane"
    {
    }
}
def Xform "Strong"
{
    rel material:binding = </Red> (
        bindMaterialAs = "strongerThanDescendants"
    )
    def Cube "Own"
    {
        rel material:binding = </Blue>
    }
}
)"));
  Geometry geometry(stage);
  CHECK(geometry.material(*stage.find("/A/Own")) == "/Blue");
  CHECK(geometry.material(*stage.find("/A/Plain")) == "/Red");
  CHECK(geometry.material(*stage.find("/A/Pane")) == "/Blue");
  CHECK(geometry.material(*stage.find("/Strong/Own")) == "/Red");
}

TEST_CASE("map functions compose and turn around", "[composition]") {
  const MapFunction reference = MapFunction::between("/Model", "/World/Chair");
  CHECK(reference.to_target("/Model/Part.x") == "/World/Chair/Part.x");
  CHECK_FALSE(reference.to_target("/Other"));
  CHECK(reference.inverse().to_target("/World/Chair") == "/Model");
  const MapFunction twice = MapFunction::between("/World", "/Stage").compose(reference);
  CHECK(twice.to_target("/Model/A") == "/Stage/Chair/A");
  const MapFunction open = reference.with_root_identity();
  CHECK(open.to_target("/Other") == "/Other");
  // The referenced prim covers this path, so nothing maps there from itself.
  CHECK_FALSE(open.to_target("/World/Chair/A"));
}

TEST_CASE("a package is read in place, with members that refer to each other", "[usdz]") {
  const TemporaryFolder folder;
  const auto number16 = [](std::size_t n) {
    return std::string{static_cast<char>(n & 255), static_cast<char>((n >> 8) & 255)};
  };
  const auto number32 = [&](std::size_t n) { return number16(n) + number16(n >> 16); };
  std::string zip;
  std::string directory;
  int count = 0;
  const auto add_member = [&](const std::string& name, const std::string& text) {
    const std::string sizes = number32(text.size()) + number32(text.size());
    directory += std::string("PK\1\2", 4) + number16(20) + number16(20) + number16(0) +
                 number16(0) + number32(0) + number32(0) + sizes + number16(name.size()) +
                 number16(0) + number16(0) + number16(0) + number16(0) + number32(0) +
                 number32(zip.size()) + name;
    zip += std::string("PK\3\4", 4) + number16(20) + number16(0) + number16(0) + number32(0) +
           number32(0) + sizes + number16(name.size()) + number16(5) + name +
           std::string("\0\0\1\0x", 5) + text;
    ++count;
  };
  add_member("main.usda", kHeader + R"(
(
    defaultPrim = "P"
)
def "P" (
    references = @parts/part.usda@</Part>
)
{
}
)");
  add_member("parts/part.usda", kHeader + R"(
def "Part"
{
    int x = 9
    asset picture = @../wood.png@
}
)");
  const std::size_t start = zip.size();
  zip += directory + std::string("PK\5\6", 4) + number32(0) + number16(count) + number16(count) +
         number32(directory.size()) + number32(start) + number16(0);
  const std::string file = folder.write("a.usdz", zip);
  Stage stage(file);
  CHECK(number(stage, "/P") == 9.0);
  CHECK(stage.anchor(stage.find_value(*stage.find("/P"), "picture")) == file + "[wood.png]");
  const auto changed = [&](std::size_t field, char value) {
    std::string other = zip;
    other[start + field] = value;
    return folder.write("changed.usdz", other);
  };
  CHECK_THROWS_WITH(Stage(changed(8, 1)), ContainsSubstring("member main.usda is encrypted"));
  CHECK_THROWS_WITH(Stage(changed(10, 12)),
                    ContainsSubstring("member main.usda uses compression method 12"));
  // A comment that holds the mark of the directory's end.
  std::string commented = zip;
  commented[zip.size() - 2] = 30;
  commented += std::string("PK\5\6", 4) + std::string(26, 'x');
  CHECK(Stage(folder.write("commented.usdz", commented)).find("/P"));
  CHECK_THROWS_WITH(Stage(folder.write("cut.usdz", zip.substr(0, zip.size() - 10))),
                    ContainsSubstring("cut.usdz: the package has no directory at byte offset"));
}

}  // namespace diorama::usd
