// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <string>

#include "loader_usd/usd/error.h"
#include "loader_usd/usd/layer.h"
#include "loader_usd/usd/path.h"
#include "loader_usd/usd/text_reader.h"
#include "support/catch.h"

namespace diorama::usd {
namespace {

std::shared_ptr<Layer> read(const std::string& body) {
  return read_text_layer("test.usda", "#usda 1.0\n" + body);
}

std::string error_of(const std::string& body) {
  try {
    read(body);
  } catch (const FormatError& error) {
    return error.what();
  }
  return "no error";
}

Value attribute(const Layer& layer, const char* prim, const char* name,
                const char* field = "default") {
  const PropertySpec* spec = layer.prim(prim)->property(name);
  return spec ? layer.get(spec->fields, field) : Value();
}

}  // namespace

TEST_CASE("a text layer holds the values that it says", "[usda]") {
  const auto layer = read(R"(
(
    metersPerUnit = 0.01
    upAxis = "Z"
    defaultPrim = "Room"
)
def Xform "Room" (
    kind = "assembly"
    prepend apiSchemas = ["PhysicsCollisionAPI"]
)
{
    uniform token[] xformOpOrder = ["xformOp:orient"]
    quatf xformOp:orient = (0.5, 0.1, 0.2, 0.3)
    custom float size = .5 (
        doc = """two
lines"""
    )
    point3f[] points = [(1, 2, 3), (-4.5, 5e-1, inf),]
    int64 big = -9223372036854775808
    uchar small = 255
    asset file = @a b.png@
    string text = "tab\t\"quoted\" \x41"
    matrix4d m = ( (1, 2, 3, 4), (5, 6, 7, 8), (9, 10, 11, 12), (13, 14, 15, 16) )
    half h = 0.333333
    float moving.timeSamples = { 2: 20, 1: 10, 3: None, }
    rel target = [</Room/A>, <../Other>]
}
)");
  CHECK(layer->get(layer->root(), "metersPerUnit").as_number() == 0.01);
  CHECK(*layer->get(layer->root(), "upAxis").as_text() == "Z");
  const PrimSpec& room = *layer->prim("/Room");
  CHECK(*layer->get(room, "kind").as_text() == "assembly");
  CHECK(layer->get(room, "apiSchemas").as_string_list_op()->prepended ==
        Strings{"PhysicsCollisionAPI"});

  // The real part comes first in text and last in memory.
  const Value orient = attribute(*layer, "/Room", "xformOp:orient");
  CHECK(orient.component(3) == Approx(0.5));
  CHECK(orient.component(0) == Approx(0.1));
  CHECK(attribute(*layer, "/Room", "size").as_number() == 0.5);
  CHECK(*attribute(*layer, "/Room", "size", "documentation").as_text() == "two\nlines");
  const auto points = numbers<float>(attribute(*layer, "/Room", "points"), 3);
  REQUIRE(points);
  REQUIRE(points->span.size() == 6);
  CHECK(points->span[3] == -4.5f);
  CHECK(std::isinf(points->span[5]));
  CHECK(attribute(*layer, "/Room", "big").component(0) == -9223372036854775808.0);
  CHECK(attribute(*layer, "/Room", "small").as_number() == 255.0);
  CHECK(*attribute(*layer, "/Room", "file").as_text() == "a b.png");
  CHECK(*attribute(*layer, "/Room", "text").as_text() == "tab\t\"quoted\" A");
  CHECK(attribute(*layer, "/Room", "m").component(7) == 8.0);
  CHECK(*attribute(*layer, "/Room", "h").as_number() == Approx(1365.0 / 4096.0));
  const Value moving = attribute(*layer, "/Room", "moving", "timeSamples");
  REQUIRE(moving.as_time_samples());
  CHECK(moving.as_time_samples()->times == std::vector<double>{1, 2, 3});
  CHECK(moving.as_time_samples()->value(0).as_number() == 10.0);
  CHECK(moving.as_time_samples()->value(2).is_block());
  CHECK(attribute(*layer, "/Room", "target", "targetPaths").as_string_list_op()->explicit_items ==
        Strings{"/Room/A", "/Other"});
}

TEST_CASE("numbers may be infinite, none, or too big", "[usda]") {
  const auto layer = read(R"(
def "A"
{
    double a = inf
    double b = -inf
    double c = nan
    double d = 1e400
    float e = 1e39
    half f = 1e6
    double g = -.5e-3
    int h = -2147483648
    uint i = 4294967295
    int64 j = -9223372036854775808
    uint64 k = 18446744073709551615
    uchar l = 255
}
)");
  const auto number = [&](const char* name) { return *attribute(*layer, "/A", name).as_number(); };
  CHECK(number("a") == std::numeric_limits<double>::infinity());
  CHECK(number("b") == -std::numeric_limits<double>::infinity());
  CHECK(std::isnan(number("c")));
  CHECK(std::isinf(number("d")));
  CHECK(std::isinf(number("e")));
  CHECK(std::isinf(number("f")));
  CHECK(number("g") == -0.5e-3);
  CHECK(number("h") == -2147483648.0);
  CHECK(number("i") == 4294967295.0);
  CHECK(number("j") == -9223372036854775808.0);
  CHECK(number("k") == 18446744073709551615.0);
  CHECK(number("l") == 255.0);
}

TEST_CASE("texts and assets may hold their own marks", "[usda]") {
  const auto layer = read(R"x(
def "A"
{
    asset a = @@@foo@bar.usda@@@
    asset b = @@@a\@@@b@@@
    string c = """a "quoted"
line"""
    string d = 'it\'s \x41\101'
    string e = """"""
    string f = '''say "it's"'''
}
)x");
  const auto text = [&](const char* name) { return *attribute(*layer, "/A", name).as_text(); };
  CHECK(text("a") == "foo@bar.usda");
  CHECK(text("b") == "a@@@b");
  CHECK(text("c") == "a \"quoted\"\nline");
  CHECK(text("d") == "it's AA");
  CHECK(text("e").empty());
  CHECK(text("f") == "say \"it's\"");
}

TEST_CASE("variants are specs of their own", "[usda]") {
  const auto layer = read(R"(
def "Chair" (
    variants = { string color = "red" }
    prepend variantSets = "color"
)
{
    variantSet "color" = {
        "red" {
            def "Leg" { }
            int price = 7
        }
    }
}
)");
  CHECK(layer->prim("/Chair{color=}")->type == SpecType::VariantSet);
  CHECK(layer->prim("/Chair{color=red}")->type == SpecType::Variant);
  CHECK(layer->prim("/Chair{color=red}Leg")->type == SpecType::Prim);
  CHECK(attribute(*layer, "/Chair{color=red}", "price").as_number() == 7.0);
}

TEST_CASE("a text error says file, line and column", "[usda]") {
  CHECK(error_of("def \"A\"\n{\n    float x = one\n}\n") ==
        "test.usda:4:15: expected a number for float");
  CHECK(error_of("def \"A\" { }\ndef \"A\" { }\n") == "test.usda:3:8: there is a prim 'A' already");
  CHECK(error_of("def \"A\" { float x = 1 }\n") == "test.usda:2:23: expected the end of the line");
  CHECK(error_of("def \"A\"\n{\n    string s = \"open\n}\n") ==
        "test.usda:4:16: the string is not closed");
  CHECK(error_of("def \"A\"\n{\n    uchar x = 256\n}\n") ==
        "test.usda:4:18: 256 is not in the range of uchar");
  CHECK(error_of("def \"A\"\n{\n    rel r = <a/../b>\n}\n") ==
        "test.usda:4:13: <a/../b> is not a path");
  CHECK_THROWS_WITH(read_text_layer("x.usda", "#usda1.0\n"),
                    ContainsSubstring("x.usda:1:1: the first line of a layer must be"));
}

TEST_CASE("nesting without end is refused", "[usda]") {
  std::string prims;
  for (int i = 0; i < 100000; ++i) prims += "def \"A\"\n{\n";
  CHECK(error_of(prims).find("nested too deeply") != std::string::npos);
  CHECK(error_of("def \"A\"\n{\nint[] a = " + std::string(100000, '[') + "\n}\n")
            .find("nested too deeply") != std::string::npos);
  CHECK(error_of("(\ncustomLayerData = { dictionary a = " + std::string(10, ' ') + "\n")
            .find("expected") != std::string::npos);
}

TEST_CASE("paths are taken apart and put together", "[path]") {
  CHECK(path::parent("/A/B") == "/A");
  CHECK(path::parent("/A") == "/");
  CHECK(path::parent("/A.x") == "/A");
  CHECK(path::parent("/A{v=a}B") == "/A{v=a}");
  CHECK(path::parent("/A{v=a}") == "/A");
  CHECK(path::name("/A{v=a}B") == "B");
  CHECK(path::append_child("/A{v=a}", "B") == "/A{v=a}B");
  CHECK(path::strip_variants("/A{v=a}B/C{w=}.x") == "/A/B/C.x");
  CHECK(path::replace_prefix("/A/B", "/A", "/") == "/B");
  CHECK(path::replace_prefix("/A/B", "/A", "/X{v=a}") == "/X{v=a}B");
  CHECK(path::replace_prefix("/B", "/", "/X") == "/X/B");
  CHECK(path::has_prefix("/AB", "/A") == false);
  CHECK(path::make_absolute("../C.x", "/A/B") == "/A/C.x");
  CHECK(path::make_absolute("../../../C", "/A/B").empty());
  CHECK(path::property_part("/A{v=.a}.x:y") == "x:y");
  CHECK(path::is_valid("/A{v=a}B.c[/D.e].f"));
  CHECK_FALSE(path::is_valid("/A//B"));
  CHECK_FALSE(path::is_valid("./A"));
  CHECK(path::is_identifier("größe_2"));
  CHECK_FALSE(path::is_identifier("2a"));
}

TEST_CASE("only a whole list may be empty", "[usda]") {
  const auto in_prim = [](const std::string& line) {
    return error_of("def \"A\"\n{\n    " + line + "\n}\n");
  };
  CHECK(in_prim("int[] a = [[1, 2], [3, 4]]") == "no error");
  CHECK(in_prim("int[] a = []") == "no error");
  CHECK(in_prim("int[] a = [[]]") == "test.usda:4:18: a list within a list is empty");
  CHECK(in_prim("int[] a = [[1, 2], []]") == "test.usda:4:26: a list within a list is empty");
  CHECK(in_prim("Unknown[] a = [[]]") == "test.usda:4:21: a list within a list is empty");
}

TEST_CASE("arcs name an asset, or none at all", "[usda]") {
  CHECK(error_of("def \"A\" (\n    references = @@\n)\n{\n}\n") ==
        "test.usda:3:20: the asset of a reference is empty; a prim of the same layer is named "
        "without @@");
  CHECK(error_of("def \"A\" (\n    payload = [@a.usda@, @@</B>]\n)\n{\n}\n")
            .find("the asset of a payload is empty") != std::string::npos);
  // An attribute may say that it has none.
  CHECK(error_of("def \"A\"\n{\n    asset a = @@\n}\n") == "no error");
}

TEST_CASE("metadata that USD knows have their types", "[usda]") {
  const auto with = [](const std::string& field) {
    return error_of("def \"A\" (\n    " + field + "\n)\n{\n}\n");
  };
  CHECK(with("prefix = \"$Left\"") == "no error");
  CHECK(with("anything = 3") == "no error");
  CHECK(with("prefix = 3") == "test.usda:3:14: expected a quoted text for string");
  CHECK(with("suffix = [\"a\"]") == "test.usda:3:14: found a list where string is one value");
  CHECK(with("displayGroupOrder = \"a\"").find("expected a list") != std::string::npos);
  CHECK(with("symmetryArguments = 3").find("before a dictionary") != std::string::npos);
  CHECK(error_of("(\n    startFrame = \"x\"\n)\n").find("expected a number for double") !=
        std::string::npos);
}

TEST_CASE("display units are those that USD knows", "[usda]") {
  const auto with_unit = [](const std::string& unit) {
    return error_of("def \"A\"\n{\n    float a = 1 (\n        displayUnit = " + unit +
                    "\n    )\n}\n");
  };
  CHECK(with_unit("cm") == "no error");
  CHECK(with_unit("deg") == "no error");
  CHECK(with_unit("parsec") ==
        "test.usda:5:23: 'parsec' is not a unit; known are mm, cm, dm, m, km, in, ft, yd, mi, "
        "deg, rad, default");
  CHECK(with_unit("3").find("is not a unit") != std::string::npos);
}

TEST_CASE("old names of types stay as they are written", "[usda]") {
  const auto layer = read(
      "def \"A\"\n{\n    Vec2f[] primvars:st = [(1, 2)]\n"
      "    Transform t\n}\n");
  CHECK(*attribute(*layer, "/A", "primvars:st", "typeName").as_text() == "Vec2f[]");
  CHECK(attribute(*layer, "/A", "primvars:st").type() == Type::Vec2f);
  // Two names of one type are two types where a layer says both.
  CHECK(error_of("def \"A\"\n{\n    Vec2f a\n    float2 a = (1, 2)\n}\n") ==
        "test.usda:5:13: 'a' is of type Vec2f in one place and of type float2 in another");
}

}  // namespace diorama::usd
