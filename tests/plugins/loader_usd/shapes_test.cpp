// SPDX-License-Identifier: Apache-2.0
// Shapes, points and curves: known sizes, closed surfaces that face outwards.
#include <cmath>
#include <string>
#include <vector>

#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/mesh_checks.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {

using test::LoadedStage;
using test::TemporaryFolder;

namespace {

const std::string kHeader = "#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n";

/// The mesh of the prim /A, which is of that type and says that.
struct Made {
  TemporaryFolder folder;
  LoadedStage loaded;
  const Mesh* mesh;

  Made(const std::string& type, const std::string& body)
      : loaded(folder.write("a.usda", kHeader + "def " + type + " \"A\"\n{\n" + body + "\n}\n")),
        mesh(loaded.node("A").mesh.get()) {}
};

void check_bounds(const Mesh& mesh, const Vec3& min, const Vec3& max, double margin) {
  const Aabb bounds = mesh.bounds();
  for (int axis = 0; axis < 3; ++axis) {
    CHECK(bounds.min[axis] == Approx(min[axis]).margin(margin));
    CHECK(bounds.max[axis] == Approx(max[axis]).margin(margin));
  }
}

/// That nothing is open or faces inwards; returns the volume.
double check_solid(const Mesh& mesh) {
  const test::MeshFaults faults = test::mesh_faults(mesh);
  CHECK(faults.open_edges == 0);
  CHECK(faults.flipped == 0);
  return faults.volume;
}

}  // namespace

TEST_CASE("cylinders and capsules may have another radius at each end", "[shapes]") {
  const Made frustum("Cylinder_1",
                     "double radiusTop = 1\ndouble radiusBottom = 2\n"
                     "double height = 3\ntoken axis = \"X\"");
  REQUIRE(frustum.mesh);
  check_bounds(*frustum.mesh, {-1.5, -2, -2}, {1.5, 2, 2}, 1e-5);
  CHECK(check_solid(*frustum.mesh) == Approx(kPi * 3.0 / 3.0 * (1 + 2 + 4)).epsilon(0.01));

  const Made capsule("Capsule_1",
                     "double radiusTop = 0.5\ndouble radiusBottom = 0.25\n"
                     "double height = 2");
  REQUIRE(capsule.mesh);
  check_bounds(*capsule.mesh, {-0.5, -0.5, -1.25}, {0.5, 0.5, 1.5}, 1e-5);
  CHECK(check_solid(*capsule.mesh) > 0.0);
  const Made plain("Cylinder_1", "");
  const Made old("Cylinder", "");
  CHECK(plain.mesh->positions == old.mesh->positions);
}

TEST_CASE("shapes without a size are not there, and do no harm", "[shapes]") {
  for (const char* type : {"Sphere", "Cylinder", "Cone", "Capsule", "Capsule_1"}) {
    INFO(type);
    const Made none(type, "double radius = 0\ndouble radiusTop = 0\ndouble radiusBottom = 0");
    CHECK_FALSE(none.mesh);
    CHECK_FALSE(
        Made(type, "double radius = inf\ndouble radiusTop = nan\ndouble radiusBottom = -inf").mesh);
  }
  CHECK_FALSE(Made("Cube", "double size = 0").mesh);
  CHECK_FALSE(Made("Plane", "double width = 0").mesh);
  // A capsule without a middle part is a sphere.
  const Made ball("Capsule", "double height = 0\ndouble radius = 2");
  REQUIRE(ball.mesh);
  check_bounds(*ball.mesh, {-2, -2, -2}, {2, 2, 2}, 1e-5);
}

TEST_CASE("points are balls as wide as their widths", "[shapes]") {
  const Made points("Points", R"(
    point3f[] points = [(0, 0, 0), (5, 0, 0), (0, 0, 7), (nan, 0, 0)]
    float[] widths = [1, 4, 0, 1]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] (
        interpolation = "vertex"
    )
)");
  REQUIRE(points.mesh);
  check_bounds(*points.mesh, {-0.5, -2, -2}, {7, 2, 2}, 1e-5);
  CHECK(check_solid(*points.mesh) == Approx(kPi / 6.0 * (1 + 64)).epsilon(0.1));
  for (std::size_t i = 0; i < points.mesh->positions.size(); ++i) {
    const bool is_first = points.mesh->positions[i].x() < 1.0f;
    CHECK(points.mesh->colors[i] == (is_first ? Vec3f(1, 0, 0) : Vec3f(0, 1, 0)));
  }
  // One of the points is none.
  CHECK(points.loaded.host.warnings.size() == 1);

  const Made even("Points", R"(
    point3f[] points = [(0, 0, 0), (5, 0, 0)]
    float[] widths = [2] (
        interpolation = "constant"
    )
)");
  check_bounds(*even.mesh, {-1, -1, -1}, {6, 1, 1}, 1e-5);
}

TEST_CASE("linear curves are tubes with closed ends, or rings", "[shapes]") {
  const Made two("BasisCurves", R"(
    uniform token type = "linear"
    int[] curveVertexCounts = [2, 3]
    point3f[] points = [(0, 0, 0), (0, 0, 4), (10, 0, 0), (10, 0, 2), (10, 0, 4)]
    float[] widths = [2, 1] (
        interpolation = "uniform"
    )
)");
  REQUIRE(two.mesh);
  check_bounds(*two.mesh, {-1, -1, 0}, {10.5, 1, 4}, 0.05);
  // Of regular polygons with twelve sides.
  const double share = 6.0 / kPi * std::sin(kPi / 6.0);
  CHECK(check_solid(*two.mesh) == Approx(share * kPi * 4.0 * (1 + 0.25)).epsilon(1e-4));

  const Made ring("BasisCurves", R"(
    uniform token type = "linear"
    uniform token wrap = "periodic"
    int[] curveVertexCounts = [4]
    point3f[] points = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)]
    float[] widths = [0.5] (
        interpolation = "constant"
    )
)");
  REQUIRE(ring.mesh);
  CHECK(ring.mesh->triangles.size() == 4 * 12 * 2);
  CHECK(check_solid(*ring.mesh) > 0.0);
}

TEST_CASE("cubic curves run between the points that their basis says", "[shapes]") {
  struct Case {
    const char* basis;
    const char* wrap;
    double first;
    double last;
  };
  const std::vector<Case> cases{{"bezier", "nonperiodic", 0, 3},
                                {"bspline", "nonperiodic", 1, 2},
                                {"bspline", "pinned", 0, 3},
                                {"catmullRom", "nonperiodic", 1, 2},
                                {"catmullRom", "pinned", 0, 3}};
  for (const Case& each : cases) {
    INFO(each.basis << ' ' << each.wrap);
    const Made curve("BasisCurves", std::string("uniform token basis = \"") + each.basis +
                                        "\"\nuniform token wrap = \"" + each.wrap + R"("
    int[] curveVertexCounts = [4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]
    float[] widths = [0, 1, 2, 3]
)");
    REQUIRE(curve.mesh);
    const Aabb bounds = curve.mesh->bounds();
    CHECK(bounds.min.x() == Approx(each.first).margin(1e-5));
    CHECK(bounds.max.x() == Approx(each.last).margin(1e-5));
    // The widths are those of the same places.
    CHECK(bounds.max.y() == Approx(0.5 * each.last).epsilon(0.05));
    CHECK(check_solid(*curve.mesh) > 0.0);
  }
}

TEST_CASE("points and curves without widths are named, not drawn", "[shapes]") {
  const Made points("Points", "point3f[] points = [(0, 0, 0)]");
  CHECK_FALSE(points.mesh);
  REQUIRE(points.loaded.host.warnings.size() == 1);
  CHECK(points.loaded.host.warnings[0].ends_with(
      "a.usda: </A> is of type Points without widths, which is not drawn"));
  // Nothing is missing where there is nothing.
  CHECK(Made("Points", "").loaded.host.warnings.empty());
  // Counts that the points do not fill, and widths that do not suffice.
  const Made broken("BasisCurves", R"(
    uniform token type = "linear"
    int[] curveVertexCounts = [2, -1, 7]
    point3f[] points = [(0, 0, 0), (0, 0, 4), (0, 0, 5)]
    float[] widths = [1]
)");
  REQUIRE(broken.mesh);
  CHECK(broken.mesh->bounds().max.z() == 4.0);
}

}  // namespace diorama::loader_usd
