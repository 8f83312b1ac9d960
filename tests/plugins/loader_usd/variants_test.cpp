// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "diorama/error.h"
#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {
namespace {

using diorama::test::TemporaryFolder;
using Loaded = diorama::test::LoadedStage;

/// A mug that selects "blue" and "small", over a layer that knows "green" as well. The wheel inside
/// of it has a set of the same name.
std::string write_mug(const TemporaryFolder& folder) {
  folder.write("more.usda", R"(#usda 1.0
(
    defaultPrim = "Mug"
)
def Xform "Mug" (
    prepend variantSets = "look"
)
{
    variantSet "look" = {
        "green" {
            def Cube "Green"
            {
            }
        }
    }
}
)");
  return folder.write("mug.usda", R"(#usda 1.0
(
    defaultPrim = "Mug"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Mug" (
    prepend references = @more.usda@
    prepend variantSets = ["look", "size"]
    variants = {
        string look = "blue"
        string size = "small"
    }
)
{
    def Xform "Wheel" (
        prepend variantSets = "look"
        variants = { string look = "blue" }
    )
    {
        variantSet "look" = {
            "blue" {
                def Cube "BlueWheel"
                {
                }
            }
            "red" {
                def Cube "RedWheel"
                {
                }
            }
        }
    }
    variantSet "look" = {
        "blue" {
            def Cube "Blue"
            {
            }
        }
        "red" {
            def Cube "Red"
            {
            }
        }
    }
    variantSet "size" = {
        "small" {
            def Cube "Small"
            {
            }
        }
        "big" {
            def Cube "Big"
            {
            }
        }
    }
}
)");
}

bool has(const Loaded& loaded, const std::string& part) {
  return bool(loaded.scene.find("/asset/Mug/" + part));
}

}  // namespace

TEST_CASE("a name chooses variants of the root prim, whatever it selects", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string file = write_mug(folder);
  const Loaded own(file);
  CHECK((has(own, "Blue") && has(own, "Small") && !has(own, "Red") && !has(own, "Big")));
  const Loaded red(file + "{look=red}");
  CHECK((has(red, "Red") && has(red, "Small") && !has(red, "Blue")));
  // What lies below has selections of its own.
  CHECK(has(red, "Wheel/BlueWheel"));
  const Loaded both(file + "{size=big}{look=green}");
  CHECK((has(both, "Green") && has(both, "Big") && !has(both, "Small") && !has(both, "Blue")));
  CHECK(both.host.warnings.empty());
  CHECK(UsdLoader({}, const_cast<Loaded&>(both).host).files(file + "{look=red}").size() == 2);
}

TEST_CASE("a variant that is not there is an error that lists those that are", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string file = write_mug(folder);
  CHECK_THROWS_WITH(Loaded(file + "{look=pink}"),
                    file +
                        ": has no variant 'pink' of a set 'look'; there is look: blue green red; "
                        "size: big small");
  CHECK_THROWS_WITH(Loaded(file + "{colour=red}"),
                    file +
                        ": has no variant 'red' of a set 'colour'; there is look: blue green "
                        "red; size: big small");
  CHECK_THROWS_WITH(Loaded(file + "{look}"),
                    file + "{look}: found '{look}', expected variants as {set=variant}");
  CHECK_THROWS_WITH(Loaded(file + "{look=red}x}"),
                    file + "{look=red}x}: found 'x}', expected variants as {set=variant}");
  const std::string plain = folder.write("plain.usda", "#usda 1.0\ndef Cube \"C\"\n{\n}\n");
  CHECK_THROWS_WITH(Loaded(plain + "{look=red}"),
                    plain +
                        ": has no variant 'red' of a set 'look'; there are none at its root "
                        "prims");
  // A file may really be called so.
  const std::string odd = folder.write("odd.usda{look=red}", "#usda 1.0\ndef Cube \"C\"\n{\n}\n");
  CHECK(Loaded(odd).scene.find("/asset/C"));
}

}  // namespace diorama::loader_usd
