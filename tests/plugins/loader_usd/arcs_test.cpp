// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "loader_usd/usd/asset_library.h"
#include "loader_usd/usd/stage.h"
#include "plugins/loader_usd/stage_files.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::usd {

TEST_CASE("classes beat references, references beat what is specialized", "[specification]") {
  Files files;
  files.add("weak.usda", R"(
over "P" (
    delete references = </Late>
)
{
}
)");
  Stage stage = files.open(R"((
    subLayers = [@weak.usda@]
)
def "P" (
    specializes = </S>
    inherits = </I>
    references = [</R>, </Late>]
)
{
}
class "S"
{
    int x = 2
    int y = 2
    int z = 2
}
class "I"
{
    int x = 3
}
class "R"
{
    int x = 1
    int y = 1
}
class "Late"
{
    int y = 7
    int w = 7
}
)");
  CHECK(x_of(stage, "/P", "x") == 3);
  CHECK(x_of(stage, "/P", "y") == 1);
  CHECK(x_of(stage, "/P", "z") == 2);
  // The explicit list of the stronger layer replaces what the weaker one deletes.
  CHECK(x_of(stage, "/P", "w") == 7);
}

TEST_CASE("a variant of a reference of a payload brings a payload of its own", "[specification]") {
  Files files;
  files.add("leaf.usda", R"((
    defaultPrim = "/L/Deep"
)
def "L"
{
    def "Deep"
    {
        def "FromLeaf"
        {
        }
    }
}
)");
  files.add("model.usda", R"((
    defaultPrim = "M"
)
class "K"
{
    def "FromClass"
    {
    }
}
def "M" (
    inherits = </K>
    variants = {
        string v = "a"
    }
    prepend variantSets = "v"
)
{
    reorder nameChildren = ["Z", "FromClass"]
    def "Y"
    {
    }
    def "Z"
    {
    }
    variantSet "v" = {
        "a" {
            def "A"
            {
            }
        }
        "b" (
            prepend payload = @./leaf.usda@
        ) {
            def "B"
            {
            }
        }
    }
}
)");
  files.add("room.usda", R"(
def "Q" (
    references = @model.usda@
)
{
}
)");
  Stage stage = files.open(R"(
def "P" (
    payload = @room.usda@</Q>
    variants = {
        string v = "b"
    }
)
{
}
)");
  CHECK(children_of(stage, "/P") == Strings{"FromLeaf", "B", "Z", "FromClass", "Y"});
}

TEST_CASE("root prims are ordered by every layer, the strongest last", "[specification]") {
  Files files;
  files.add("weak.usda", "def \"Zero\"\n{\n}\ndef \"Three\"\n{\n}\n");
  Stage stage = files.open(R"((
    subLayers = [@weak.usda@]
)
reorder rootPrims = ["Two", "One"]
def "One"
{
}
def "Two"
{
}
over "Three"
{
}
)");
  CHECK(children_of(stage, "/") == Strings{"Zero", "Three", "Two", "One"});
}

TEST_CASE("the first sample is that of the stage's time", "[specification]") {
  const test::TemporaryFolder folder;
  folder.write("clip.usda",
               "#usda 1.0\ndef \"A\"\n{\n    double x.timeSamples = { 1: 4, 5: 7 }\n}\n");
  const auto x_by = [&](const std::string& offset) {
    Stage stage(folder.write("root.usda",
                             "#usda 1.0\n(\n    subLayers = [@clip.usda@ (" + offset + ")]\n)\n"),
                Sampling::OrFirstSample);
    return x_of(stage, "/A");
  };
  CHECK(x_by("offset = 10; scale = 2") == 4);
  CHECK(x_by("offset = 10; scale = -2") == 7);
}

TEST_CASE("instances within instances are shared and keep their overrides out", "[specification]") {
  Files files;
  files.add("leg.usda", "def \"Leg\"\n{\n    def \"Foot\"\n    {\n        int x = 1\n    }\n}\n");
  files.add("chair.usda", R"(
def "Chair"
{
    def "Left" (
        instanceable = true
        references = @leg.usda@</Leg>
    )
    {
        over "Foot"
        {
            int x = 2
        }
    }
}
)");
  Stage stage = files.open(R"(
def "A" (
    instanceable = true
    references = @chair.usda@</Chair>
)
{
    over "Left"
    {
        over "Foot"
        {
            int x = 3
        }
    }
}
)");
  CHECK(x_of(stage, "/A/Left/Foot") == 1);
  CHECK(stage.find("/A/Left")->is_instance);
  CHECK(stage.find("/A/Left/Foot")->is_instance_proxy);
}

TEST_CASE("assets stand where the layer that names them stands", "[specification]") {
  const AssetLibrary library;
  const auto anchor = [&](const char* asset) { return library.anchor(asset, "/room/layer.usda"); };
  CHECK(anchor("b.png") == "/room/b.png");
  CHECK(anchor("./b.png") == "/room/b.png");
  CHECK(anchor("../b.png") == "/b.png");
  CHECK(anchor("../../b.png") == "/b.png");
  CHECK(anchor("a/./c//../b.png") == "/room/a/b.png");
  CHECK(anchor("/else/../b.png") == "/b.png");
  CHECK(anchor("https://a/../b.png") == "https://a/../b.png");
  CHECK(anchor("p.usdz[t/b.png]") == "/room/p.usdz[t/b.png]");
  CHECK(anchor("").empty());
  CHECK(library.anchor("../b.png", "/p.usdz[a/c/l.usda]") == "/p.usdz[a/b.png]");
}

}  // namespace diorama::usd
