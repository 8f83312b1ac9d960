// SPDX-License-Identifier: Apache-2.0
#include "modelling/shapes.h"

#include <array>

#include "support/catch.h"
#include "support/mesh_checks.h"

using namespace diorama;
using namespace diorama::modelling;

namespace {

/// A pose that turns, moves and mirrors.
Affine skewed() { return at(0.3, -0.7, 1.1) * turned_z(0.8) * turned_x(0.4) * scaled(-1, 1, 1); }

double volume_of(MeshBuilder& builder) {
  const auto mesh = builder.build();
  CHECK_NOTHROW(mesh->validate("shape"));
  const test::MeshFaults faults = test::mesh_faults(*mesh);
  CHECK(faults.open_edges == 0);
  CHECK(faults.flipped == 0);
  CHECK(faults.degenerate == 0);
  return faults.volume;
}

}  // namespace

TEST_CASE("a bevelled box is closed and only its edges are missing", "[modelling]") {
  MeshBuilder builder;
  builder.begin(skewed(), {});
  add_box(builder, Vec3(0.4, 0.2, 0.1), 0.01, Axis::X, 4);
  const double volume = volume_of(builder);
  // Rounding takes (1 - pi / 4) r^2 from each metre of edge, a little more at corners.
  const double edges = 4 * (0.4 + 0.2 + 0.1);
  CHECK(volume == Approx(0.4 * 0.2 * 0.1 - edges * (1 - kPi / 4) * 1e-4).epsilon(0.004));
}

TEST_CASE("a turned profile has the volume of the body that it sweeps", "[modelling]") {
  MeshBuilder builder;
  builder.begin(skewed(), {});
  // A tube: outer radius 0.3, inner 0.2, 0.5 tall.
  const std::array<ProfilePoint, 5> ring{{{0.3, 0}, {0.3, 0.5}, {0.2, 0.5}, {0.2, 0}, {0.3, 0}}};
  add_lathe(builder, ring, 256);
  CHECK(volume_of(builder) == Approx(kPi * (0.09 - 0.04) * 0.5).epsilon(1e-3));
}

TEST_CASE("a swept tube has section times length", "[modelling]") {
  MeshBuilder builder;
  builder.begin(skewed(), {});
  const std::array<Vec3, 3> path{Vec3(0, 0, 0), Vec3(0.1, 0.3, 0.05), Vec3(0.4, 0.5, 0.2)};
  const std::vector<Vec3> curve = smooth_path(path, 16);
  double length = 0;
  for (std::size_t i = 1; i < curve.size(); ++i) length += (curve[i] - curve[i - 1]).norm();
  add_tube(builder, curve, 0.01, 64);
  CHECK(volume_of(builder) == Approx(kPi * 1e-4 * length).epsilon(0.01));
}

TEST_CASE("a prism over a hollow outline is triangulated inside of it", "[modelling]") {
  MeshBuilder builder;
  builder.begin(skewed(), {});
  const std::array<Vec2, 6> corner{Vec2(0, 0),     Vec2(0.4, 0),   Vec2(0.4, 0.1),
                                   Vec2(0.1, 0.1), Vec2(0.1, 0.3), Vec2(0, 0.3)};
  add_prism(builder, corner, 0.05, 0.0);
  CHECK(volume_of(builder) == Approx((0.4 * 0.1 + 0.1 * 0.2) * 0.05));
}

TEST_CASE("a panel loses its openings, a moulding runs around corners", "[modelling]") {
  MeshBuilder builder;
  builder.begin(skewed(), {});
  const std::array<Opening, 2> holes{Opening{0.5, 1.5, 0, 2}, Opening{2, 3, 0.9, 2.2}};
  add_panel(builder, 4, 0.25, 2.8, holes);
  CHECK(volume_of(builder) == Approx((4 * 2.8 - 1 * 2 - 1 * 1.3) * 0.25));

  builder.begin(skewed(), {});
  const std::array<Vec2, 4> section{Vec2(0, 0), Vec2(0.02, 0), Vec2(0.02, 0.1), Vec2(0, 0.1)};
  const std::array<Vec2, 4> room{Vec2(0, 0), Vec2(5, 0), Vec2(5, 4), Vec2(0, 4)};
  add_moulding(builder, section, room, true);
  // Mitred at the middle of the section: the centre line is 0.01 inside.
  CHECK(volume_of(builder) == Approx(0.02 * 0.1 * 2 * (4.98 + 3.98)).epsilon(1e-4));

  builder.begin(skewed(), {});
  const std::array<Vec2, 3> open{Vec2(0, 0), Vec2(2, 0), Vec2(2, 1)};
  add_moulding(builder, section, open, false);
  CHECK(volume_of(builder) == Approx(0.02 * 0.1 * (2 + 1 - 2 * 0.01)).epsilon(1e-4));
}

TEST_CASE("a sheet has its thickness on both sides of the surface", "[modelling]") {
  MeshBuilder builder;
  builder.begin(skewed(), {});
  const auto dome = [](double u, double v) {
    return Vec3(0.6 * u, 0.4 * v, 0.05 * std::sin(kPi * u) * std::sin(kPi * v));
  };
  add_sheet(builder, 40, 40, 0.004, dome, Vec2(0.6, 0.4));
  // The dome's area is a little more than its plan.
  const double volume = volume_of(builder);
  CHECK(volume > 0.6 * 0.4 * 0.004);
  CHECK(volume < 1.1 * 0.6 * 0.4 * 0.004);
}

TEST_CASE("equal parts differ in their cut of the texture only", "[modelling]") {
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {0, 2.0, Vec2(0.25, 0.5)});
  add_picture(builder, 0.3, 0.2);
  const auto mesh = builder.build();
  CHECK(mesh->uvs[0] == Vec2f(0.25f, 0.5f));
  CHECK(mesh->uvs[2] == Vec2f(2.25f, 2.5f));
  CHECK(mesh->material_slots.empty());
}
