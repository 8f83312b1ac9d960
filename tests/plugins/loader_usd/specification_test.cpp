// SPDX-License-Identifier: Apache-2.0
// Rules of composition that few files exercise; each answer follows from the rules themselves:
// strength order local, inherits, variants, references, payloads, specializes, by recursion.
#include <string>

#include "loader_usd/usd/extent.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/stage.h"
#include "plugins/loader_usd/stage_files.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::usd {
namespace {

using diorama::test::TemporaryFolder;

/// A model `M` of two variants, a and b; a is selected.
std::string model_of_two(const std::string& a, const std::string& b) {
  return R"(
def "M" (
    variants = {
        string v = "a"
    }
    variantSets = "v"
)
{
    variantSet "v" = {
        "a" {
            )" +
         a + R"(
        }
        "b" {
            )" +
         b + R"(
        }
    }
}
)";
}

}  // namespace

TEST_CASE("a set inside of a variant is selected from outside of the reference",
          "[specification]") {
  Files files;
  files.add("asset.usda", R"(
def "M" (
    variants = {
        string model = "big"
        string look = "blue"
    }
    prepend variantSets = "model"
)
{
    variantSet "model" = {
        "big" (
            prepend variantSets = "look"
        ) {
            int size = 2
            variantSet "look" = {
                "red" {
                    int x = 1
                }
                "blue" {
                    int x = 2
                }
            }
        }
        "small" {
            int size = 1
        }
    }
}
)");
  Stage stage = files.open(R"(
def "P" (
    references = @asset.usda@</M>
    variants = {
        string look = "red"
    }
)
{
}
def "Q" (
    references = @asset.usda@</M>
    variants = {
        string model = "small"
    }
)
{
}
)");
  CHECK(x_of(stage, "/P") == 1);
  CHECK(x_of(stage, "/P", "size") == 2);
  CHECK(x_of(stage, "/Q") == -1);
  CHECK(x_of(stage, "/Q", "size") == 1);
}

TEST_CASE("a class is implied through the variant that holds the reference", "[specification]") {
  Files files;
  files.add("asset.usda", R"(
class "C"
{
    int x = 1
    int y = 1
}
def "M" (
    inherits = </C>
)
{
}
)");
  Stage stage = files.open(R"(
class "C"
{
    int x = 2
}
def "P" (
    variants = {
        string v = "a"
    }
    variantSets = "v"
)
{
    variantSet "v" = {
        "a" (
            references = @asset.usda@</M>
        ) {
        }
    }
}
)");
  CHECK(x_of(stage, "/P") == 2);
  CHECK(x_of(stage, "/P", "y") == 1);
}

TEST_CASE("an inherited class may select variants, and a weaker selection yields",
          "[specification]") {
  Files files;
  files.add("asset.usda", model_of_two("int x = 1", "int x = 2"));
  Stage stage = files.open(R"(
class "C" (
    variants = {
        string v = "b"
    }
)
{
}
def "P" (
    inherits = </C>
    references = @asset.usda@</M>
)
{
}
)");
  CHECK(x_of(stage, "/P") == 2);
}

TEST_CASE("a specialized class is implied, and stays the weakest", "[specification]") {
  Files files;
  files.add("asset.usda", R"(
class "S"
{
    int x = 1
    int y = 1
    int z = 1
}
def "M" (
    specializes = </S>
)
{
    int z = 4
}
)");
  Stage stage = files.open(R"(
class "S"
{
    int x = 3
    int y = 3
    int z = 3
}
class "I"
{
    int y = 5
}
def "P" (
    inherits = </I>
    references = @asset.usda@</M>
)
{
}
)");
  CHECK(x_of(stage, "/P", "x") == 3);
  CHECK(x_of(stage, "/P", "y") == 5);
  CHECK(x_of(stage, "/P", "z") == 4);
}

TEST_CASE("references are edited by what they lead to, not by how they are written",
          "[specification]") {
  Files files;
  for (const std::string name : {"a", "b"}) {
    files.add("sub/" + name + ".usda", "(\n    defaultPrim = \"M\"\n)\ndef \"M\"\n{\n    int x = " +
                                           std::string(name == "a" ? "1" : "2") + "\n    int " +
                                           name + " = 1\n}\n");
  }
  files.add("sub/weak.usda", R"(
over "Deleted" (
    prepend references = [@a.usda@, @./b.usda@]
)
{
}
over "Moved" (
    prepend references = [@a.usda@, @b.usda@]
)
{
}
over "Replaced" (
    prepend references = [@a.usda@]
)
{
}
over "Cleared" (
    prepend references = [@a.usda@]
)
{
}
)");
  Stage stage = files.open(R"((
    subLayers = [@sub/weak.usda@]
)
def "Deleted" (
    delete references = @sub/a.usda@
)
{
}
def "Moved" (
    append references = @./sub/a.usda@
)
{
}
def "Replaced" (
    references = @sub/b.usda@
)
{
}
def "Cleared" (
    references = None
)
{
}
)");
  CHECK(x_of(stage, "/Deleted") == 2);
  CHECK(x_of(stage, "/Deleted", "a") == -1);
  CHECK(x_of(stage, "/Moved") == 2);
  CHECK(x_of(stage, "/Moved", "a") == 1);
  CHECK(x_of(stage, "/Replaced", "a") == -1);
  CHECK(x_of(stage, "/Replaced", "b") == 1);
  CHECK(x_of(stage, "/Cleared", "a") == -1);
}

TEST_CASE("what an asset relocates is overridden at its new place", "[specification]") {
  Files files;
  files.add("base.usda", R"(
def "M"
{
    def "A"
    {
        def "Deep"
        {
            int x = 1
            int y = 1
        }
        def "Gone"
        {
        }
        def "Stays"
        {
        }
    }
}
)");
  files.add("asset.usda", R"((
    relocates = {
        </M/A/Deep>: </M/Deep>,
        </M/A/Gone>: <>
    }
)
def "M" (
    references = @base.usda@</M>
)
{
}
)");
  Stage stage = files.open(R"(
def "P" (
    references = @asset.usda@</M>
)
{
    over "Deep"
    {
        int x = 2
    }
}
def "Plain" (
    references = @asset.usda@</M>
)
{
}
)");
  CHECK(children_of(stage, "/P") == Strings{"A", "Deep"});
  CHECK(children_of(stage, "/Plain") == Strings{"A", "Deep"});
  CHECK(children_of(stage, "/P/A") == Strings{"Stays"});
  CHECK(x_of(stage, "/P/Deep") == 2);
  CHECK(x_of(stage, "/P/Deep", "y") == 1);
}

TEST_CASE("relocates follow each other over references", "[specification]") {
  Files files;
  files.add("base.usda", R"(
def "I"
{
    def "One"
    {
        int x = 7
    }
}
)");
  files.add("inner.usda", R"((
    relocates = {
        </I/One>: </I/Group/Two>
    }
)
def "I" (
    references = @base.usda@</I>
)
{
    def "Group"
    {
    }
}
)");
  files.add("outer.usda", R"((
    relocates = {
        </O/Part/Group/Two>: </O/Three>
    }
)
def "O"
{
    def "Part" (
        references = @inner.usda@</I>
    )
    {
    }
}
)");
  Stage stage = files.open(R"(
def "P" (
    references = @outer.usda@</O>
)
{
}
)");
  // What is relocated to a place comes before what the layer itself has there.
  CHECK(children_of(stage, "/P") == Strings{"Three", "Part"});
  CHECK(children_of(stage, "/P/Part") == Strings{"Group"});
  CHECK(children_of(stage, "/P/Part/Group").empty());
  CHECK(x_of(stage, "/P/Three") == 7);
}

TEST_CASE("instances with other selections are other shapes", "[specification]") {
  Files files;
  files.add("asset.usda",
            model_of_two("def \"Part\" { int x = 1\n}", "def \"Part\" { int x = 2\n}"));
  Stage stage = files.open(R"(
def "A" (
    instanceable = true
    references = @asset.usda@</M>
)
{
    over "Part"
    {
        int x = 9
    }
}
def "B" (
    instanceable = true
    references = @asset.usda@</M>
    variants = {
        string v = "b"
    }
)
{
}
)");
  CHECK(x_of(stage, "/A/Part") == 1);
  CHECK(x_of(stage, "/B/Part") == 2);
}

TEST_CASE("at the default time the strongest default counts, samples of any layer do not",
          "[specification]") {
  Files files;
  files.add("weak.usda", R"(
def "P"
{
    double x = 5
    double y = 6
    double y.timeSamples = {
        1: 60,
        2: 61,
    }
    double z.timeSamples = {
        3: 70,
        1: 71,
    }
    double blocked = 4
}
)");
  const std::string root = R"((
    subLayers = [@weak.usda@]
)
over "P"
{
    double x.timeSamples = {
        1: 50,
    }
    double blocked = None
}
)";
  Stage stage = files.open(root);
  CHECK(x_of(stage, "/P") == 5);
  CHECK(x_of(stage, "/P", "y") == 6);
  CHECK(x_of(stage, "/P", "z") == -1);
  CHECK(x_of(stage, "/P", "blocked") == -1);
  const TemporaryFolder folder;
  folder.write("weak.usda",
               "#usda 1.0\ndef \"P\"\n{\n    double z.timeSamples = {\n        3: 70,\n"
               "        1: 71,\n    }\n}\n");
  Stage first(folder.write("root.usda", "#usda 1.0\n(\n    subLayers = [@weak.usda@]\n)\n"),
              Sampling::OrFirstSample);
  CHECK(x_of(first, "/P", "z") == 71);
}

TEST_CASE("names and texts may be any Unicode, texts may hold escapes", "[specification]") {
  Files files;
  files.add("\xc3\xa4rger/größe.usda", R"(
def "Räume"
{
    def "名前" (
        customData = {
            dictionary nested = {
                string "a key" = "b"
                double[] list = [1, 2.5, -inf]
            }
        }
    )
    {
        string text = "tab\there, \"quoted\", \x41\102, 'single' and back\\slash"
        int x = 3
    }
}
)");
  Stage stage = files.open(R"(
def "P" (
    references = @ärger/größe.usda@</Räume>
)
{
}
)");
  CHECK(stage.warnings().empty());
  CHECK(children_of(stage, "/P") == Strings{"名前"});
  const Value text = stage.value(*stage.find("/P/名前"), "text");
  REQUIRE(text.as_text());
  CHECK(*text.as_text() == "tab\there, \"quoted\", AB, 'single' and back\\slash");
}

TEST_CASE("an instancer leaves out ids that are invisible or inactive", "[specification]") {
  Files files;
  files.add("weak.usda", R"(
over "I" (
    inactiveIds = [30]
)
{
}
)");
  Stage stage = files.open(R"((
    subLayers = [@weak.usda@]
)
def PointInstancer "I" (
    append inactiveIds = [40]
)
{
    rel prototypes = [</I/A>, </Elsewhere>]
    int[] protoIndices = [0, 1, 0, 1, 0]
    int64[] ids = [10, 20, 30, 40, 50]
    int64[] invisibleIds = [20]
    point3f[] positions = [(1, 0, 0), (2, 0, 0), (3, 0, 0), (4, 0, 0), (5, 0, 0)]
    def Cube "A"
    {
    }
}
def Sphere "Elsewhere"
{
}
)");
  std::vector<double> places;
  for (const PointInstance& instance : point_instances(stage, *stage.find("/I")).list) {
    places.push_back(instance.instancer_from_prototype.m[12]);
  }
  CHECK(places == std::vector<double>{1, 5});
}

TEST_CASE("lists of schemas are edited layer by layer", "[specification]") {
  Files files;
  files.add("weak.usda", R"(
def "P" (
    prepend apiSchemas = ["A", "B", "C"]
)
{
}
)");
  Stage stage = files.open(R"((
    subLayers = [@weak.usda@]
)
over "P" (
    delete apiSchemas = ["B"]
    append apiSchemas = ["A"]
)
{
}
)");
  CHECK(stage.metadata_list(*stage.find("/P"), "apiSchemas") == Strings{"C", "A"});
}

TEST_CASE("an arc without a prim leads to the default prim, also below the root",
          "[specification]") {
  Files files;
  files.add("deep.usda", R"((
    defaultPrim = "/A/B"
)
def "A"
{
    def "B"
    {
        int x = 8
    }
}
)");
  files.add("none.usda", "def \"A\"\n{\n}\n");
  Stage stage = files.open(R"(
def "P" (
    references = @deep.usda@
)
{
}
def "Q" (
    references = @none.usda@
)
{
}
)");
  CHECK(x_of(stage, "/P") == 8);
  REQUIRE(stage.find("/Q"));
  REQUIRE(stage.warnings().size() == 1);
  CHECK(stage.warnings()[0].find("none.usda") != std::string::npos);
}

TEST_CASE("inherits lead to classes inside of other prims, and bring their children in order",
          "[specification]") {
  Files files;
  Stage stage = files.open(R"(
def "Group"
{
    class "C"
    {
        def "Second"
        {
        }
        def "First"
        {
        }
    }
    def "P" (
        inherits = </Group/C>
    )
    {
        reorder nameChildren = ["First", "Second"]
        def "Own"
        {
        }
    }
}
)");
  CHECK(children_of(stage, "/Group") == Strings{"P"});
  // What is not ordered stays behind its neighbour.
  CHECK(children_of(stage, "/Group/P") == Strings{"First", "Own", "Second"});
}

TEST_CASE("targets are edited in every layer and mapped through references", "[specification]") {
  Files files;
  files.add("asset.usda", R"(
def "M"
{
    rel r = [</M/A>, </M/B>]
    def "A"
    {
    }
    def "B"
    {
    }
}
)");
  Stage stage = files.open(R"(
def "P" (
    references = @asset.usda@</M>
)
{
    delete rel r = </P/A>
    prepend rel r = </Other>
}
def "Other"
{
}
)");
  CHECK(stage.targets(*stage.find("/P"), "r") == Strings{"/Other", "/P/B"});
}

TEST_CASE("what is bound for a purpose comes before what is bound for all", "[specification]") {
  Files files;
  Stage stage = files.open(R"(
def Material "Full"
{
}
def Material "All"
{
}
def Material "Part"
{
}
def Xform "Up"
{
    rel material:binding:full = </Full>
    rel material:binding:collection:preview:few = [</Up.collection:few>, </Part>]
    rel collection:few:includes = </Up/Pane>
    def Cube "C"
    {
        rel material:binding = </All>
    }
    def Cube "Pane"
    {
        rel material:binding = </All>
    }
}
)");
  Geometry geometry(stage);
  CHECK(geometry.material(*stage.find("/Up/C")) == "/All");
  CHECK(geometry.material(*stage.find("/Up/C"), "full") == "/Full");
  CHECK(geometry.material(*stage.find("/Up/C"), "preview") == "/All");
  CHECK(geometry.material(*stage.find("/Up/Pane"), "preview") == "/Part");
}

}  // namespace diorama::usd
