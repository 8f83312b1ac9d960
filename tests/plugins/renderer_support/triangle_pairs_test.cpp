// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/triangle_pairs.h"

#include <algorithm>
#include <set>

#include "support/catch.h"

namespace diorama {
namespace {

constexpr std::uint32_t kNone = TrianglePair::kNone;

const Vec3f& corner_position(const Mesh& mesh, std::uint32_t corner) {
  return mesh.positions[mesh.triangles[corner / 3][corner % 3]];
}

bool meets(const Vec3f& a, const Vec3f& b) { return a == b || (a.hasNaN() && b.hasNaN()); }

Mesh mesh_of(std::vector<Vec3f> positions, std::vector<std::array<std::uint32_t, 3>> triangles) {
  Mesh mesh;
  mesh.positions = std::move(positions);
  mesh.triangles = std::move(triangles);
  return mesh;
}

/// The same triangles, none of which shares a vertex with another.
Mesh with_seams(const Mesh& mesh) {
  Mesh apart;
  for (const auto& triangle : mesh.triangles) {
    const auto first = std::uint32_t(apart.positions.size());
    for (const std::uint32_t v : triangle) apart.positions.push_back(mesh.positions[v]);
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  return apart;
}

/// Pairs of triangle numbers, after checking what holds of all pairs: each triangle is in one, and
/// the halves run through their common edge in opposite directions.
std::set<std::set<std::uint32_t>> checked_pairs(const Mesh& mesh) {
  std::vector<int> uses(mesh.triangles.size(), 0);
  std::set<std::set<std::uint32_t>> result;
  for (const auto& [a, c] : pair_triangles(mesh)) {
    ++uses.at(a / 3);
    if (c == kNone) continue;
    ++uses.at(c / 3);
    CHECK(a / 3 < c / 3);
    const std::uint32_t b = next_corner(a);
    const std::uint32_t d = next_corner(b);
    CHECK(meets(corner_position(mesh, b), corner_position(mesh, next_corner(next_corner(c)))));
    CHECK(meets(corner_position(mesh, d), corner_position(mesh, next_corner(c))));
    result.insert({a / 3, c / 3});
  }
  CHECK(std::all_of(uses.begin(), uses.end(), [](int count) { return count == 1; }));
  return result;
}

using Pairs = std::set<std::set<std::uint32_t>>;

}  // namespace

TEST_CASE("the sides of a box are pairs", "[pairs]") {
  const Pairs sides{{0, 1}, {2, 3}, {4, 5}, {6, 7}, {8, 9}, {10, 11}};
  const Mesh box = make_box(Vec3(0.3, 0.5, 0.7));
  CHECK(checked_pairs(box) == sides);
  CHECK(checked_pairs(with_seams(box)) == sides);
}

TEST_CASE("the cells of a strip are pairs, also where uvs or normals split its vertices",
          "[pairs]") {
  Mesh strip;
  for (int i = 0; i < 8; ++i) {
    // Zeros of both signs are the same place.
    strip.positions.emplace_back(0.5f * float(i), i % 2 == 0 ? 0.0f : -0.0f, 0.0f);
    strip.positions.emplace_back(0.5f * float(i), 1.3f, 0.1f * float(i % 3));
  }
  Pairs cells;
  for (std::uint32_t i = 0; i < 7; ++i) {
    const std::uint32_t v = 2 * i;
    strip.triangles.push_back({v, v + 2, v + 3});
    strip.triangles.push_back({v + 3, v + 1, v});
    cells.insert({v, v + 1});
  }
  CHECK(checked_pairs(strip) == cells);
  Mesh apart = with_seams(strip);
  for (std::size_t i = 0; i < apart.positions.size(); i += 2) apart.positions[i].y() += -0.0f;
  CHECK(checked_pairs(apart) == cells);
}

TEST_CASE("only triangles that share the longest edge of both are paired", "[pairs]") {
  // A fan of narrow triangles: the longest edge is the longer of both spokes.
  const float lengths[] = {5.0f, 1.0f, 4.0f, 2.0f, 3.0f};
  Mesh fan = mesh_of({Vec3f(0.2f, -0.1f, 0.4f)}, {});
  for (int i = 0; i < 5; ++i) {
    const float angle = 0.1f * float(i);
    fan.positions.push_back(fan.positions[0] +
                            lengths[i] * Vec3f(std::cos(angle), std::sin(angle), 0.0f));
  }
  for (std::uint32_t i = 1; i < 5; ++i) fan.triangles.push_back({0, i, i + 1});
  CHECK(checked_pairs(fan) == Pairs{{1, 2}});
}

TEST_CASE("triangles of opposite winding stay alone", "[pairs]") {
  const std::vector<Vec3f> positions{{0, 0, 0}, {2, 1, 0}, {0, 1, 0.2f}, {2, 0, 0.3f}};
  CHECK(checked_pairs(mesh_of(positions, {{0, 1, 2}, {1, 0, 3}})) == Pairs{{0, 1}});
  CHECK(checked_pairs(mesh_of(positions, {{0, 1, 2}, {0, 1, 3}})).empty());
}

TEST_CASE("equal triangles stay alone, front and back of one are a pair", "[pairs]") {
  const std::vector<Vec3f> positions{{0, 0, 0}, {2, 1, 0}, {0, 1, 0.2f}};
  CHECK(checked_pairs(mesh_of(positions, {{0, 1, 2}, {0, 1, 2}, {1, 2, 0}})).empty());
  CHECK(checked_pairs(mesh_of(positions, {{0, 1, 2}, {2, 1, 0}})) == Pairs{{0, 1}});
}

TEST_CASE("an edge of many triangles makes pairs of some", "[pairs]") {
  const std::vector<Vec3f> positions{{0, 0, 0}, {3, 0, 0}, {1, 1, 0}, {1, 0, 1}, {1, -1, 0}};
  CHECK(checked_pairs(mesh_of(positions, {{0, 1, 2}, {0, 1, 3}, {1, 0, 4}})) == Pairs{{0, 2}});
  CHECK(checked_pairs(mesh_of(positions, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {1, 0, 2}})) ==
        Pairs{{0, 1}, {2, 3}});
}

TEST_CASE("triangles without area, broken ones and none at all are fine", "[pairs]") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Vec3f> positions{{0, 0, 0}, {1, 2, 0}, {2, 4, 0}, {3, 1, 1}, {nan, 0, 1}};
  CHECK(checked_pairs(mesh_of(positions, {})).empty());
  checked_pairs(mesh_of(positions, {{0, 0, 0}, {0, 0, 1}, {0, 1, 2}, {2, 1, 0}, {0, 2, 3}}));
  checked_pairs(mesh_of(positions, {{4, 4, 4}, {0, 4, 1}, {4, 0, 1}, {4, 4, 4}}));
}

TEST_CASE("a hundred thousand triangles at one edge take no long searches", "[pairs]") {
  Mesh mesh = mesh_of({{0, 0, 0}, {3, 0, 0}, {1, 1, 0}}, {});
  mesh.triangles.assign(100'000, {0, 1, 2});
  CHECK(checked_pairs(mesh).empty());
  for (std::size_t i = 0; i < mesh.triangles.size(); i += 2) mesh.triangles[i] = {2, 1, 0};
  CHECK(checked_pairs(mesh).size() == 50'000);
}

}  // namespace diorama
