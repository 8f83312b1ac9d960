// SPDX-License-Identifier: Apache-2.0
#include "diorama/geometry.h"

#include <map>
#include <set>
#include <tuple>

#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

/// Index per position, equal positions sharing one: the surface without its seams.
std::vector<std::uint32_t> welded(const Mesh& mesh) {
  std::map<std::tuple<float, float, float>, std::uint32_t> known;
  std::vector<std::uint32_t> indices;
  for (const Vec3f& p : mesh.positions) {
    const auto next = std::uint32_t(known.size());
    // Adding 0 makes -0 and 0 one.
    indices.push_back(
        known.emplace(std::tuple(p.x() + 0.0f, p.y() + 0.0f, p.z() + 0.0f), next).first->second);
  }
  return indices;
}

/// Closed and consistently turned: each edge is used once in each direction. Euler: V - E + F = 2.
void check_closed(const Mesh& mesh) {
  const std::vector<std::uint32_t> index = welded(mesh);
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  std::set<std::uint32_t> vertices;
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = index[triangle[k]], to = index[triangle[(k + 1) % 3]];
      REQUIRE(from != to);
      REQUIRE(edges.emplace(from, to).second);
      vertices.insert(from);
    }
  }
  for (const auto& [from, to] : edges) REQUIRE(edges.contains({to, from}));
  CHECK(long(vertices.size()) - long(edges.size() / 2) + long(mesh.triangles.size()) == 2);
}

double volume(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 pa = mesh.positions[a].cast<double>(), pb = mesh.positions[b].cast<double>(),
               pc = mesh.positions[c].cast<double>();
    sum += pa.dot(pb.cross(pc)) / 6.0;
  }
  return sum;
}

/// Vertex normals are unit length and on the side that the triangle's winding calls outside.
void check_normals(const Mesh& mesh) {
  REQUIRE(mesh.normals.size() == mesh.positions.size());
  REQUIRE(mesh.uvs.size() == mesh.positions.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3f face = (mesh.positions[b] - mesh.positions[a])
                           .cross(mesh.positions[c] - mesh.positions[a])
                           .normalized();
    for (const std::uint32_t i : {a, b, c}) {
      REQUIRE(mesh.normals[i].norm() == Approx(1.0f));
      REQUIRE(face.dot(mesh.normals[i]) > 0.9f);
      REQUIRE(mesh.uvs[i].minCoeff() >= 0.0f);
      REQUIRE(mesh.uvs[i].maxCoeff() <= 1.0f);
    }
  }
}

/// u and v run right and up on every triangle as seen from outside: textures are not mirrored.
void check_uv_turn(const Mesh& mesh) {
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec2f ab = mesh.uvs[b] - mesh.uvs[a], ac = mesh.uvs[c] - mesh.uvs[a];
    REQUIRE(ab.x() * ac.y() - ab.y() * ac.x() > 0.0f);
  }
}

void check_primitive(const Mesh& mesh, double expected_volume, double tolerance, const Vec3& size) {
  mesh.validate("primitive");
  check_closed(mesh);
  check_normals(mesh);
  check_uv_turn(mesh);
  CHECK(volume(mesh) == Approx(expected_volume).epsilon(tolerance));
  CHECK(mesh.bounds().size().isApprox(size, 1e-6));
  CHECK(mesh.bounds().centre().norm() < 1e-6);
}

/// Area of the regular polygon that stands for the circle.
double polygon_area(double radius, int n) {
  return 0.5 * n * radius * radius * std::sin(2.0 * kPi / n);
}

}  // namespace

TEST_CASE("Primitives are closed, turned outward and of the right volume", "[geometry]") {
  check_primitive(make_box(Vec3(1, 2, 3)), 6.0, 1e-6, Vec3(1, 2, 3));
  // Prisms and pyramids over the polygon are exact.
  check_primitive(make_cylinder(0.5, 2.0, 24), polygon_area(0.5, 24) * 2.0, 1e-5, Vec3(1, 1, 2));
  check_primitive(make_cone(0.5, 3.0, 24), polygon_area(0.5, 24), 1e-5, Vec3(1, 1, 3));
  check_primitive(make_sphere(2.0, 96), 4.0 / 3.0 * kPi * 8.0, 3e-3, Vec3(4, 4, 4));
  check_primitive(make_capsule(0.5, 2.0, 96), kPi * 0.25 * 2.0 + 4.0 / 3.0 * kPi * 0.125, 3e-3,
                  Vec3(1, 1, 3));
}

TEST_CASE("The normals of a sphere point from its centre", "[geometry]") {
  const Mesh sphere = make_sphere(2.0, 16);
  for (std::size_t i = 0; i < sphere.positions.size(); ++i) {
    CHECK(sphere.normals[i].isApprox(sphere.positions[i] / 2.0f, 1e-5f));
  }
}

TEST_CASE("A plane lies in xy and faces +z", "[geometry]") {
  const Mesh plane = make_plane(2.0, 6.0);
  CHECK(plane.bounds().size() == Vec3(2, 6, 0));
  check_normals(plane);
  check_uv_turn(plane);
}

TEST_CASE("Primitives refuse sizes that make none", "[geometry]") {
  const std::string sizes = ": sizes must be finite and greater than 0";
  CHECK(test::error_text([] { make_box(Vec3(1, 0, 1)); }) == "box" + sizes);
  CHECK(test::error_text([] { make_sphere(-1.0); }) == "sphere" + sizes);
  CHECK(test::error_text([] { make_cone(1.0, kInfinity); }) == "cone" + sizes);
  CHECK(test::error_text([] { make_sphere(1.0, 2); }) == "expected 3 to 100000 segments, found 2");
}

TEST_CASE("Smooth normals weigh faces by area", "[geometry]") {
  Mesh mesh;
  // A large triangle facing +z and a small one facing +x share vertex 0.
  mesh.positions = {{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {0, 1, 0}, {0, 0, 1}, {9, 9, 9}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 4}};
  const std::vector<Vec3f> normals = smooth_normals(mesh);
  CHECK(normals[0].isApprox(Vec3f(1, 0, 9).normalized(), 1e-5f));
  CHECK(normals[1] == Vec3f(0, 0, 1));
  CHECK(normals[4] == Vec3f(1, 0, 0));
  CHECK(normals[5] == Vec3f(0, 0, 1));
}

TEST_CASE("A bad mesh is refused with the place of what is wrong", "[geometry]") {
  const auto text = [](auto&& spoil) {
    Mesh mesh = make_box(Vec3(1, 1, 1));
    spoil(mesh);
    return test::error_text([&] { mesh.validate("cup.obj"); });
  };
  CHECK(text([](Mesh&) {}) == "(no error)");
  CHECK(text([](Mesh& m) { m.normals.pop_back(); }) ==
        "cup.obj: the mesh has 23 normals, expected 24 or none");
  CHECK(text([](Mesh& m) { m.material_slots.resize(5); }) ==
        "cup.obj: the mesh has 5 material slots, expected 12 or none");
  CHECK(text([](Mesh& m) { m.triangles[3][1] = 24; }) ==
        "cup.obj: triangle 3 of the mesh uses position 24, there are 24");
  CHECK(text([](Mesh& m) { m.positions[7].y() = std::numeric_limits<float>::quiet_NaN(); }) ==
        "cup.obj: position 7 of the mesh is not finite");
}
