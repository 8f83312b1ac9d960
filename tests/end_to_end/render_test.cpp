// SPDX-License-Identifier: Apache-2.0
#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

/// A red square of 2 m in the plane z = 0, seen from above by one camera, lit by nothing.
constexpr const char* kSquare = R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World"
{
    def Mesh "Square"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        color3f[] primvars:displayColor = [(0.8, 0.05, 0.05)]
    }
    def Camera "Above"
    {
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
)";

std::vector<std::string> picture(std::vector<std::string> more, const char* renderer = "null") {
  std::vector<std::string> all{"render", "square.usda", "--renderer", renderer};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace

TEST_CASE("render writes one picture of a file, by its camera or by a new one", "[render]") {
  const TemporaryFolder folder;
  write_file(folder / "square.usda", kSquare);
  const Outcome own = run(picture({"-o", "own.png", "--width", "64"}), folder.path());
  INFO(own.errors);
  REQUIRE(own.exit_code == 0);
  CHECK_THAT(own.errors, ContainsSubstring("/World/Above, 64x"));
  CHECK(read_file(folder / "own.png").substr(1, 3) == "PNG");
  const Outcome placed = run(picture({"-o", "new.jpg", "--eye", "3", "0", "4", "--target", "0", "0",
                                      "0", "--width", "64", "--height", "32"}),
                             folder.path());
  INFO(placed.errors);
  REQUIRE(placed.exit_code == 0);
  CHECK_THAT(placed.errors, ContainsSubstring("/RenderCamera, 64x32"));
  const auto left = tree(folder.path());
  CHECK(left.size() == 3);
}

TEST_CASE("render refuses what cannot be rendered and leaves no picture", "[render][errors]") {
  const TemporaryFolder folder;
  write_file(folder / "square.usda", kSquare);
  const auto refused = [&](std::vector<std::string> more, const std::string& message,
                           const char* renderer = "null") {
    const Outcome outcome = run(picture(std::move(more), renderer), folder.path());
    INFO(outcome.errors);
    CHECK(outcome.exit_code != 0);
    CHECK(outcome.exit_code < 128);
    CHECK_THAT(outcome.errors, ContainsSubstring(message));
    CHECK(tree(folder.path()).size() == 1);
  };
  refused({"-o", "x.tif"}, "expected .png, .jpg, .exr or .hdr");
  refused({"--camera", "Below"}, "no camera 'Below'; there are /");
  refused({"--set", "samplez=3"}, "unknown key 'samplez'");
  refused({}, "null", "nulll");
  refused({"--eye", "1", "2", "3", "--target", "1", "2", "3"}, "the same point");
  refused({"-o", "nowhere/x.png"}, "nowhere/x.png");
}
