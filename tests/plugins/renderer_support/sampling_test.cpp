// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/sampling.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <span>
#include <tuple>
#include <vector>

#include "diorama/rng.h"
#include "renderer_support/dome.h"
#include "renderer_support/microfacet.h"
#include "renderer_support/sky_grid.h"
#include "renderer_support/sobol.h"
#include "renderer_support/sun_grid.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

/// Compares how many samples fall into cells of the sphere with the integral of their density.
/// Returns Pearson's chi-square over its degrees of freedom: about 1 when they agree.
double chi_square(const std::function<Vec3f(const Vec2f&)>& sample,
                  const std::function<float(const Vec3f&)>& density) {
  constexpr int kRows = 16;
  constexpr int kColumns = 24;
  constexpr int kSamples = 200000;
  constexpr int kSub = 24;  // integration points per cell and axis
  std::vector<double> counts(kRows * kColumns, 0.0);
  Rng rng(77);
  for (int i = 0; i < kSamples; ++i) {
    const Vec3f d = sample({float(rng.uniform()), float(rng.uniform())});
    REQUIRE(d.norm() == Approx(1.0f).margin(1e-4));
    const double phi = std::atan2(double(d.y()), double(d.x())) + kPi;
    const int row = std::clamp(int((1.0 - double(d.z())) / 2.0 * kRows), 0, kRows - 1);
    const int column = std::clamp(int(phi / (2.0 * kPi) * kColumns), 0, kColumns - 1);
    counts[std::size_t(row * kColumns + column)] += 1.0;
  }
  double sum = 0.0;
  int cells = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      double expected = 0.0;
      for (int i = 0; i < kSub * kSub; ++i) {
        const double z = 1.0 - 2.0 * (row + (i % kSub + 0.5) / kSub) / kRows;
        const double phi = (column + (i / kSub + 0.5) / kSub) / kColumns * 2.0 * kPi - kPi;
        const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
        const Vec3f d(float(r * std::cos(phi)), float(r * std::sin(phi)), float(z));
        expected += double(density(d)) / (kSub * kSub) * 4.0 * kPi / (kRows * kColumns);
      }
      expected *= kSamples;
      const double found = counts[std::size_t(row * kColumns + column)];
      if (expected < 20.0) {
        CHECK(found <= expected + 30.0);
        continue;
      }
      sum += (found - expected) * (found - expected) / expected;
      ++cells;
    }
  }
  REQUIRE(cells > 3);
  return sum / cells;
}

}  // namespace

TEST_CASE("cosine-weighted directions follow their density", "[sampling]") {
  CHECK(chi_square(&cosine_hemisphere,
                   [](const Vec3f& d) { return std::max(0.0f, d.z()) / kPiF; }) < 1.4);
}

TEST_CASE("directions in a cone follow their density", "[sampling]") {
  const float one_minus_cos = 0.35f;
  CHECK(chi_square([&](const Vec2f& u) { return uniform_cone(u, one_minus_cos); },
                   [&](const Vec3f& d) {
                     return 1.0f - d.z() <= one_minus_cos ? 1.0f / (2.0f * kPiF * one_minus_cos)
                                                          : 0.0f;
                   }) < 4.0);  // the rim cuts a row of cells, which the grid integrates coarsely
}

TEST_CASE("visible normals of GGX follow their density", "[sampling]") {
  for (const float alpha : {0.3f, 0.9f}) {
    for (const Vec3f& raw : {Vec3f(0.3f, -0.2f, 0.9f), Vec3f(-0.9f, 0.3f, 0.25f)}) {
      const Vec3f w = raw.normalized();
      CAPTURE(alpha, w.transpose());
      CHECK(chi_square([&](const Vec2f& u) { return ggx_visible_normal(w, alpha, u); },
                       [&](const Vec3f& h) {
                         return h.z() > 0.0f ? ggx_visible_normal_density(w, h, alpha) : 0.0f;
                       }) < 1.5);
    }
  }
}

TEST_CASE("a dome is sampled as bright as it is", "[sampling]") {
  auto texture = std::make_shared<Texture>();
  texture->width = 48;
  texture->height = 24;
  texture->channels = 3;
  Rng rng(5);
  for (int i = 0; i < 48 * 24 * 3; ++i) texture->floats.push_back(float(rng.uniform(0.1, 1.0)));
  for (int k = 0; k < 3; ++k) texture->floats[std::size_t((7 * 48 + 17) * 3 + k)] = 40.0f;
  const DomeTexture dome(*texture);
  // One half of the world sees nothing of the sky but a part.
  test::RenderHost host(2);
  const SkyGrid everything(dome);
  const Aabb bounds{Vec3(-2, -1, -3), Vec3(2, 4, 3)};
  const auto sees = [](std::span<const CellGrid::Ray> rays) {
    std::uint32_t lit = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      lit |= std::uint32_t(rays[i].origin.x() > 0.0f || rays[i].direction.y() > 0.6f) << i;
    }
    return lit;
  };
  const SkyGrid part(dome, Eigen::Matrix3f::Identity(), bounds, sees, host);
  CHECK(part.power(part.grid().cell(Vec3f(-1, 0, 0))) <
        0.4f * part.power(part.grid().cell(Vec3f(1, 0, 0))));
  for (const SkyGrid* grid : {&everything, &part}) {
    const std::uint32_t cell = grid->grid().cell(Vec3f(-1.0f, 0.5f, 1.0f));
    const auto draw = [&](const Vec2f& u) {
      const SkyGrid::Choice choice = grid->choose(cell, u.x());
      const DomeTexture::Draw d = dome.sample(choice.patch, {choice.rest, u.y()});
      const DomeTexture::Towards towards = DomeTexture::towards(d.place);
      return std::tuple(towards.direction, d.density * towards.per_solid_angle * choice.probability,
                        d.place);
    };
    const auto density = [&](const Vec3f& d) {
      const DomeTexture::Place place = dome.place(d);
      return place.density * grid->probability(cell, place.patch);
    };
    CHECK(chi_square([&](const Vec2f& u) { return std::get<0>(draw(u)); }, density) < 3.0);
    // Sampling and density agree direction by direction, and radiance / density stays bounded.
    int differing = 0;
    for (int i = 0; i < 2000; ++i) {
      const auto [d, p, at] = draw({float(rng.uniform()), float(rng.uniform())});
      differing += std::abs(density(d) / p - 1.0f) > 0.02f;  // on a cell's rim
      const Vec3f radiance = dome.radiance_at(at);
      const Vec3f again = dome.place(d).radiance;
      CHECK((again - radiance).norm() < 0.02f * (1.0f + radiance.norm()));
      if (grid == &everything) CHECK(luminance(radiance) / p < 60.0f);
    }
    CHECK(differing < 10);
  }
}

// Light of patches that a cell does not expect is left to what surfaces scatter by chance.
TEST_CASE("a room's cells know what they see through its window", "[sampling]") {
  Texture white;
  white.width = 64;
  white.height = 32;
  white.channels = 3;
  white.floats.assign(64 * 32 * 3, 1.0f);
  const DomeTexture dome(white);
  test::RenderHost host(2);
  const Aabb bounds{Vec3(0, 0, 0), Vec3(5, 4, 3)};
  const auto is_through_window = [](const CellGrid::Ray& ray) {
    if (ray.direction.y() <= 0.0f) return false;
    const Vec3f p = ray.origin + (4.0f - ray.origin.y()) / ray.direction.y() * ray.direction;
    return p.x() > 1.0f && p.x() < 2.2f && p.z() > 1.0f && p.z() < 2.0f;
  };
  const auto sees = [&](std::span<const CellGrid::Ray> rays) {
    std::uint32_t lit = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      lit |= std::uint32_t(is_through_window(rays[i])) << i;
    }
    return lit;
  };
  const SkyGrid grid(dome, Eigen::Matrix3f::Identity(), bounds, sees, host);
  Rng rng(7);
  double all = 0.0;
  double unexpected = 0.0;
  for (int i = 0; i < 400; ++i) {
    const Vec3f place(float(rng.uniform(0.0, 5.0)), float(rng.uniform(0.0, 4.0)),
                      float(rng.uniform(0.0, 3.0)));
    const std::uint32_t cell = grid.grid().cell(place);
    std::array<double, DomeTexture::kPatches> light{};
    double sum = 0.0;
    for (int patch = 0; patch < DomeTexture::kPatches; ++patch) {
      constexpr int kRays = 40;
      for (int k = 0; k < kRays; ++k) {
        const Vec2f u(float(rng.uniform()), float(rng.uniform()));
        const Vec3f towards = DomeTexture::towards(dome.sample(patch, u).place).direction;
        if (is_through_window({place, towards})) {
          light[std::size_t(patch)] += double(dome.patch_power(patch)) / kRays;
        }
      }
      sum += light[std::size_t(patch)];
    }
    if (sum == 0.0) continue;
    for (int patch = 0; patch < DomeTexture::kPatches; ++patch) {
      const double part = light[std::size_t(patch)] / sum;
      all += part;
      if (double(grid.probability(cell, patch)) < 0.1 * part) unexpected += part;
    }
  }
  CHECK(all > 100.0);
  CHECK(unexpected < 0.02 * all);
}

TEST_CASE("a room's cells know from which share of them the sun is seen", "[sampling]") {
  test::RenderHost host(2);
  const Vec3f towards = Vec3f(0.3f, -0.2f, 0.9f).normalized();
  // Twelve cells along x and y, six along z. The sun shines on what lies beyond x = 2.05.
  const Aabb bounds{Vec3(0, 0, 0), Vec3(6, 4.8, 3)};
  std::atomic<std::size_t> asked = 0;
  std::atomic<bool> is_off = false;
  const auto sees = [&](std::span<const CellGrid::Ray> rays) {
    std::uint32_t lit = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ++asked;
      is_off = is_off || rays[i].direction.dot(towards) < std::cos(0.1f) - 1e-5f;
      lit |= std::uint32_t(rays[i].origin.x() > 2.05f) << i;
    }
    return lit;
  };
  const SunGrid grid(towards, 1.0f - std::cos(0.1f), bounds, sees, host);
  CHECK_FALSE(is_off);
  CHECK(asked < 12u * 12u * 6u * 130u);  // most cells agree with those around
  const auto share = [&](float x) { return grid.share(Vec3f(x, 2.0f, 1.0f)); };
  CHECK(share(5.0f) == 1.0f);
  CHECK(share(2.1f) == Approx(0.9f).margin(0.06));
  CHECK(share(2.4f) == share(2.01f));                       // of one cell
  CHECK(share(1.8f) == Approx(0.2f * 0.9f).margin(0.012));  // a neighbour sees it
  CHECK(share(1.2f) == CellGrid::kUnseenShare);
  CHECK(share(-7.0f) == share(0.1f));  // outside is as the nearest cell
  CHECK(SunGrid().share(Vec3f(3, 4, 5)) == 1.0f);
}

TEST_CASE("points of a triangle are spread evenly", "[sampling]") {
  Rng rng(3);
  int in_corner = 0;
  constexpr int kSamples = 100000;
  Vec2 sum = Vec2::Zero();
  for (int i = 0; i < kSamples; ++i) {
    const Vec2f b = triangle_from_square({float(rng.uniform()), float(rng.uniform())});
    REQUIRE(b.minCoeff() >= 0.0f);
    REQUIRE(b.sum() <= 1.0f);
    in_corner += b.x() > 0.5f;
    sum += b.cast<double>();
  }
  CHECK(in_corner / double(kSamples) == Approx(0.25).margin(0.005));
  CHECK(sum.x() / kSamples == Approx(1.0 / 3.0).margin(0.003));
  CHECK(sum.y() / kSamples == Approx(1.0 / 3.0).margin(0.003));
}

TEST_CASE("a basis is right-handed and orthonormal, also at the poles", "[sampling]") {
  Rng rng(9);
  for (int i = 0; i < 1000; ++i) {
    Vec3f n = rng.unit_vector().cast<float>();
    if (i == 0) n = -Vec3f::UnitZ();
    if (i == 1) n = Vec3f::UnitZ();
    const Basis basis = basis_around(n);
    CHECK((basis.x.cross(basis.y) - basis.z).norm() < 1e-5f);
    CHECK((basis.to_world(basis.to_local(Vec3f(1, 2, 3))) - Vec3f(1, 2, 3)).norm() < 1e-5f);
  }
}

/// The pair of one dimension.
Vec2f drawn(const SampleOrder& order, int x, int y, std::uint32_t sample, int dimension) {
  PathSampler sampler(order.place(x, y, sample));
  for (int d = 0; d < dimension; ++d) sampler.next();
  return sampler.next();
}

/// Whether each of as many slices of either axis as there are points holds exactly one.
bool fills_slices(const std::vector<Vec2f>& points) {
  std::vector<int> columns(points.size(), 0);
  std::vector<int> rows(points.size(), 0);
  for (const Vec2f& p : points) {
    ++columns[std::size_t(p.x() * float(points.size()))];
    ++rows[std::size_t(p.y() * float(points.size()))];
  }
  const auto count = std::ptrdiff_t(points.size());
  return std::count(columns.begin(), columns.end(), 1) == count &&
         std::count(rows.begin(), rows.end(), 1) == count;
}

TEST_CASE("the samples of one pixel are better spread than chance", "[sampling]") {
  // Every power of two of samples, planned or only begun.
  for (const std::uint32_t count : {16u, 64u, 256u}) {
    for (const std::uint32_t planned : {count, 4 * count}) {
      for (int dimension = 0; dimension < 3; ++dimension) {
        std::vector<Vec2f> points;
        for (std::uint32_t i = 0; i < count; ++i) {
          points.push_back(drawn(SampleOrder(42, planned), 13, 7, i, dimension));
        }
        CHECK(fills_slices(points));
      }
    }
  }
}

TEST_CASE("the samples of neighbouring pixels complete each other", "[sampling]") {
  const SampleOrder order(7, 4);
  for (const int side : {2, 4, 8}) {
    for (int dimension = 0; dimension < 4; ++dimension) {
      std::vector<Vec2f> points;
      for (int pixel = 0; pixel < side * side; ++pixel) {
        for (std::uint32_t i = 0; i < 4; ++i) {
          const int x = 3 * side + pixel % side;
          const int y = 5 * side + pixel / side;
          points.push_back(drawn(order, x, y, i, dimension));
        }
      }
      CHECK(fills_slices(points));
    }
  }
}

TEST_CASE("samples of different dimensions, seeds, rounds and tiles are unrelated", "[sampling]") {
  const SampleOrder order(1, 4);
  const SampleOrder other(2, 4);
  constexpr int kPixels = 20000;
  std::array<double, 6> products{};
  for (int i = 0; i < kPixels; ++i) {
    const int x = i % 200;
    const int y = i / 200;
    const auto centred = [](float value) { return double(value) - 0.5; };
    const Vec2f p = drawn(order, x, y, 3, 0);
    const Vec2f q = drawn(order, x, y, 3, 1);
    products[0] += centred(p.x()) * centred(q.x());
    products[1] += centred(p.x()) * centred(q.y());
    products[2] += centred(p.x()) * centred(p.y());
    products[3] += centred(p.x()) * centred(drawn(other, x, y, 3, 0).x());
    products[4] += centred(p.x()) * centred(drawn(order, x, y, 7, 0).x());
    products[5] += centred(p.x()) * centred(drawn(order, x + 1024, y, 3, 0).x());
  }
  for (const double product : products) CHECK(std::abs(product / kPixels) < 0.003);
}

TEST_CASE("a dielectric reflects as Fresnel says", "[sampling]") {
  CHECK(fresnel_dielectric(1.0f, 1.5f) == Approx(0.04f));
  CHECK(fresnel_dielectric(1.0f, 1.0f / 1.5f) == Approx(0.04f));
  CHECK(fresnel_dielectric(0.2f, 1.0f / 1.5f) == 1.0f);  // beyond the critical angle
  // Brewster's angle: only perpendicular light is reflected.
  const float cosine = std::cos(std::atan(1.5f));
  CHECK(fresnel_dielectric(cosine, 1.5f) == Approx(0.0739645f).epsilon(1e-3));
}

}  // namespace diorama
