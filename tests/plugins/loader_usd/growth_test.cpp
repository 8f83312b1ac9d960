// SPDX-License-Identifier: Apache-2.0
//
// Files that ask for more than they hold, by arcs to arcs to arcs.
#include <string>

#include "diorama/error.h"
#include "plugins/loader_usd/loaded_stage.h"
#include "plugins/loader_usd/stage_files.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::usd {
namespace {

// Files that each refer to the next one twice.
void write_doubling(const diorama::test::TemporaryFolder& folder, int files) {
  for (int i = 0; i < files; ++i) {
    const std::string next = "@f" + std::to_string(i + 1) + ".usda@";
    std::string text = "#usda 1.0\n(\n    defaultPrim = \"A\"\n)\ndef Xform \"A\"\n{\n";
    for (const char* name : {"l", "r"}) {
      text += std::string("    def Xform \"") + name + "\" (\n        references = " + next +
              "\n    )\n    {\n    }\n";
    }
    folder.write("f" + std::to_string(i) + ".usda", text + "}\n");
  }
  folder.write("f" + std::to_string(files) + ".usda",
               "#usda 1.0\n(\n    defaultPrim = \"A\"\n)\ndef Cube \"A\"\n{\n}\n");
}

// A prim that inherits from a class that inherits from a class ...
std::string chain(int length, const char* specifier) {
  std::string text = "def \"X\" (\n    inherits = </C0>\n)\n{\n}\n";
  for (int i = 0; i < length; ++i) {
    text += std::string(specifier) + " \"C" + std::to_string(i) + "\"";
    if (i + 1 < length) text += " (\n    inherits = </C" + std::to_string(i + 1) + ">\n)";
    text += "\n{\n";
    if (i + 1 == length) text += "    double x = 42\n";
    text += "}\n";
  }
  return text;
}

}  // namespace

TEST_CASE("references that multiply end in one message", "[composition]") {
  const diorama::test::TemporaryFolder folder;
  write_doubling(folder, 30);
  loader_usd::UsdLoader::Params params;
  params.max_prims_mib = 4;
  std::string message;
  try {
    diorama::test::LoadedStage loaded(folder.path("f0.usda"), params);
  } catch (const diorama::Error& error) {
    message = error.what();
  }
  CHECK(
      message.starts_with(folder.path("f0.usda") + ": its prims take more than 4 MiB, at </A/l/"));
  CHECK(message.find("do references multiply?") != std::string::npos);
  // Five files make 63 prims, which is nothing.
  write_doubling(folder, 5);
  const diorama::test::LoadedStage small(folder.path("f0.usda"), params);
  CHECK(small.scene.match("/asset/**").size() == 63);
}

TEST_CASE("what prims may take grows with the files", "[composition]") {
  const diorama::test::TemporaryFolder folder;
  std::string text = "#usda 1.0\n";
  for (int i = 0; i < 5000; ++i) text += "def Xform \"prim_" + std::to_string(i) + "\"\n{\n}\n";
  const std::string file = folder.write("many.usda", text);
  Stage stage(file, Sampling::DefaultTime, 1);
  CHECK(stage.visible_children(stage.root()).size() == 5000);
}

TEST_CASE("a chain of classes costs as much as it is long", "[composition]") {
  Files files;
  const auto cost = [&](int length) {
    Stage stage = files.open(chain(length, "class"));
    CHECK(children_of(stage, "/") == Strings{"X"});
    CHECK(x_of(stage, "/X") == 42.0);
    return static_cast<double>(stage.composed_bytes());
  };
  const double ratio = cost(2000) / cost(500);
  CHECK(ratio > 3.0);
  CHECK(ratio < 5.0);
}

TEST_CASE("chains of prims that can be seen are composed each", "[composition]") {
  Files files;
  Stage stage = files.open(chain(300, "def"));
  CHECK(children_of(stage, "/").size() == 301);
  CHECK(x_of(stage, "/X") == 42.0);
  CHECK(x_of(stage, "/C250") == 42.0);
  CHECK(stage.warnings().empty());
  // A chain that ends at its beginning is still found, however long.
  Stage circle = files.open("def \"X\" (\n    inherits = </C0>\n)\n{\n}\n" +
                            chain(200, "class").substr(chain(0, "class").size()) +
                            "class \"D\" (\n    inherits = </D/E>\n)\n{\n}\n");
  children_of(circle, "/");
  CHECK(x_of(circle, "/X") == 42.0);
}

TEST_CASE("a long chain that leads back to its beginning is a circle", "[composition]") {
  Files files;
  std::string text;
  for (int i = 0; i < 200; ++i) {
    text += "def \"C" + std::to_string(i) + "\" (\n    inherits = </C" +
            std::to_string((i + 1) % 200) + ">\n)\n{\n}\n";
  }
  Stage stage = files.open(text);
  CHECK(children_of(stage, "/").size() == 200);
  REQUIRE_FALSE(stage.warnings().empty());
  CHECK(stage.warnings().front().find("leads back to itself") != std::string::npos);
}

}  // namespace diorama::usd
