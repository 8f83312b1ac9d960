// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/bsdf.h"

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"

namespace diorama {
namespace {

AlbedoTables& tables() {
  static AlbedoTables made;
  return made;
}

Vec3f direction(float cos_theta, float phi = 0.7f) {
  const float s = std::sqrt(1.0f - cos_theta * cos_theta);
  return {s * std::cos(phi), s * std::sin(phi), cos_theta};
}

/// A surface with the tables that it needs.
struct Made {
  explicit Made(const SurfaceBsdf& source)
      : surface(source), layers(tables(), source.layers, source.alpha) {
    surface.table = &layers;
    if (source.transmission > 0.0f) {
      glass = std::make_unique<GlassTable>(1.5f, source.alpha);
      surface.glass = glass.get();
    }
    surface.finish();
  }
  SurfaceBsdf surface;
  LayerTable layers;
  std::unique_ptr<GlassTable> glass;
};

/// Share of uniform light that comes back to wo, by the BSDF's own sampling.
double furnace(const SurfaceBsdf& surface, float cos_theta) {
  const Bsdf bsdf(surface, direction(cos_theta));
  // An additive recurrence of three dimensions (Roberts 2018).
  constexpr int kSamples = 1 << 18;
  double sum = 0.0;
  Vec3 u = Vec3::Constant(0.5);
  for (int i = 0; i < kSamples; ++i) {
    u += Vec3(0.8191725133961645, 0.6710436067037893, 0.5497004779019703);
    u -= Vec3(u.array().floor());
    const Vec3f v = u.cast<float>().cwiseMin(0.999999f);
    sum += double(bsdf.sample(v.x(), {v.y(), v.z()}).weight.mean());
  }
  return sum / kSamples;
}

const std::vector<float> kRoughnesses{0.0f, 0.1f, 0.2f, 0.35f, 0.5f, 0.7f, 1.0f};
const std::vector<float> kCosines{0.05f, 0.2f, 0.6f, 0.99f};

float alpha_of(float roughness) { return std::max(kMinAlpha, roughness * roughness); }

/// Between 0.99 and 1 for every roughness and direction, but for the error of the
/// integration, two thousandths.
void check_furnace(SurfaceBsdf source) {
  for (const float roughness : kRoughnesses) {
    source.alpha = alpha_of(roughness);
    const Made made(source);
    const SurfaceBsdf& surface = made.surface;
    for (const float cosine : kCosines) {
      CAPTURE(roughness, cosine, surface.metallic, surface.layers.coat, surface.transmission);
      const double energy = furnace(surface, cosine);
      CHECK(energy >= 0.99);
      CHECK(energy <= 1.002);
    }
  }
}

}  // namespace

TEST_CASE("a white metal returns all light at every roughness", "[bsdf][furnace]") {
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  surface.metallic = 1.0f;
  check_furnace(surface);
}

TEST_CASE("a white dielectric returns all light at every roughness", "[bsdf][furnace]") {
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  check_furnace(surface);
  surface.layers.specular = 0.0f;
  check_furnace(surface);
  surface.layers.specular = 0.6f;
  surface.metallic = 0.5f;
  check_furnace(surface);
}

TEST_CASE("a clear coat takes from what lies below as much as it returns", "[bsdf][furnace]") {
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  for (const float coat_roughness : {0.1f, 0.6f}) {
    for (const float metallic : {0.0f, 0.4f, 1.0f}) {
      surface.layers.coat = 1.0f;
      surface.layers.coat_alpha = alpha_of(coat_roughness);
      surface.metallic = metallic;
      check_furnace(surface);
    }
  }
}

TEST_CASE("stacked lobes return as much as Blender's Principled BSDF", "[bsdf][furnace]") {
  // Radiance of a plane under a uniform white sky, seen from 0, 45, 70 and 80 degrees, rendered
  // with Blender 3.4 at 32768 samples; specular 0.5 there is an index of refraction of 1.5.
  struct Row {
    float base, roughness, metallic;
    std::array<double, 4> radiance;
  };
  const std::vector<Row> rows{{0.8f, 0.25f, 0.0f, {0.8329, 0.8427, 0.9335, 1.0356}},
                              {0.8f, 0.5f, 0.0f, {0.8420, 0.8501, 0.9079, 0.9571}},
                              {0.8f, 0.9f, 0.0f, {0.8410, 0.8447, 0.9143, 1.0246}},
                              {0.0f, 0.25f, 0.0f, {0.0399, 0.0508, 0.1610, 0.3115}},
                              {0.0f, 0.9f, 0.0f, {0.0173, 0.0216, 0.0337, 0.0442}},
                              {0.8f, 0.3f, 1.0f, {0.7925, 0.7909, 0.7876, 0.7695}},
                              {0.8f, 0.7f, 1.0f, {0.5583, 0.5507, 0.5747, 0.6104}}};
  for (const Row& row : rows) {
    SurfaceBsdf surface;
    surface.base = Vec3f::Constant(row.base);
    surface.metallic = row.metallic;
    surface.alpha = alpha_of(row.roughness);
    surface.stacks_lobes = true;
    const Made made(surface);
    for (std::size_t i = 0; i < 4; ++i) {
      const std::array<double, 4> degrees{0.0, 45.0, 70.0, 80.0};
      const double cosine = std::min(0.9999, std::cos(degrees[i] * kPi / 180.0));
      CAPTURE(row.base, row.roughness, row.metallic, degrees[i]);
      CHECK(furnace(made.surface, float(cosine)) == Approx(row.radiance[i]).epsilon(0.01));
    }
  }
}

TEST_CASE("albedos can be looked up for what is no direction", "[bsdf]") {
  AlbedoTables tables;
  const LayerTable layers(tables, {}, std::nullopt);
  const LayerTable::Row row = layers.row(0.3f);
  constexpr float kInf = std::numeric_limits<float>::infinity();
  CHECK(row.at(-kInf).isApprox(row.at(0.0f)));
  CHECK(row.at(std::numeric_limits<float>::quiet_NaN()).isApprox(row.at(0.0f)));
  // What is found means nothing, but it is looked for inside of the table.
  for (const float cosine : {1.5f, 1e9f, 1e30f}) CHECK(std::isfinite(row.at(cosine)[0]));
}

TEST_CASE("glass loses no light at every roughness, from both sides", "[bsdf][furnace]") {
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  surface.transmission = 1.0f;
  check_furnace(surface);
  surface.is_inside = true;
  check_furnace(surface);
}

TEST_CASE("light takes the same share forwards and backwards", "[bsdf]") {
  Rng rng(4);
  for (int i = 0; i < 400; ++i) {
    SurfaceBsdf surface;
    surface.base = rng.uniform_in({Vec3::Zero(), Vec3::Ones()}).cast<float>();
    surface.metallic = float(rng.uniform());
    surface.alpha = alpha_of(float(rng.uniform(0.2, 1.0)));
    surface.layers.specular = float(rng.uniform());
    surface.layers.coat = rng.chance(0.5) ? float(rng.uniform()) : 0.0f;
    surface.layers.coat_alpha = alpha_of(float(rng.uniform(0.2, 1.0)));
    const Made made(surface);
    const Vec3f a = direction(float(rng.uniform(0.05, 1.0)), float(rng.uniform(0.0, 6.0)));
    const Vec3f b = direction(float(rng.uniform(0.05, 1.0)), float(rng.uniform(0.0, 6.0)));
    const Vec3f forwards = Bsdf(made.surface, a).evaluate(b).f_cos / b.z();
    const Vec3f backwards = Bsdf(made.surface, b).evaluate(a).f_cos / a.z();
    for (int k = 0; k < 3; ++k)
      CHECK(forwards[k] == Approx(backwards[k]).epsilon(2e-3).margin(1e-5));
    CHECK(forwards.minCoeff() >= 0.0f);
  }
}

TEST_CASE("samples come with the density that evaluation states", "[bsdf]") {
  Rng rng(6);
  for (int i = 0; i < 60; ++i) {
    SurfaceBsdf surface;
    surface.base = Vec3f(0.8f, 0.5f, 0.3f);
    surface.metallic = i % 3 == 0 ? 0.0f : float(rng.uniform(0.0, 0.9));
    surface.alpha = alpha_of(float(rng.uniform(0.4, 1.0)));
    surface.layers.coat = i % 2 == 0 ? 0.8f : 0.0f;
    surface.layers.coat_alpha = alpha_of(0.5f);
    surface.transmission = i % 4 == 0 ? 0.7f : 0.0f;
    surface.is_inside = i % 8 == 0;
    const Made made(surface);
    const Bsdf bsdf(made.surface, direction(float(rng.uniform(0.2, 0.95))));
    // The density integrates to the share of samples that are not thrown away, and f cos by
    // uniform sampling equals the mean weight.
    double total = 0.0;
    double uniform_energy = 0.0;
    double energy = 0.0;
    double kept = 0.0;
    constexpr int kSamples = 60000;
    for (int s = 0; s < kSamples; ++s) {
      const Vec2f u(float(rng.uniform()), float(rng.uniform()));
      const BsdfValue value = bsdf.evaluate(uniform_sphere(u));
      total += double(value.density) * 4.0 * kPi / kSamples;
      uniform_energy += double(value.f_cos.sum()) * 4.0 * kPi / kSamples;
      const BsdfSample sample = bsdf.sample(float(rng.uniform()), u);
      kept += sample.density > 0.0f ? 1.0 / kSamples : 0.0;
      energy += double(sample.weight.sum()) / kSamples;
    }
    CAPTURE(i);
    CHECK(total <= 1.03);
    CHECK(total >= kept - 0.05);  // narrow lobes, met by chance
    CHECK(energy == Approx(uniform_energy).epsilon(0.04));
  }
}

TEST_CASE("smooth glass bends light by Snell's law", "[bsdf]") {
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  surface.transmission = 1.0f;
  surface.alpha = kMinAlpha;
  const Made made(surface);
  const Vec3f wo = direction(0.6f, 0.4f);
  const Bsdf bsdf(made.surface, wo);
  CHECK_FALSE(bsdf.has_smooth_part());
  const BsdfSample through = bsdf.sample(0.9f, {0.3f, 0.3f});
  REQUIRE(through.is_transmitted);
  CHECK(std::isinf(through.density));
  const float sin_o = std::sqrt(1.0f - 0.36f);
  CHECK(std::hypot(through.wi.x(), through.wi.y()) == Approx(sin_o / 1.5f).epsilon(1e-4));
  CHECK(through.wi.x() / through.wi.y() == Approx(wo.x() / wo.y()).epsilon(1e-3));
  CHECK(through.wi.x() * wo.x() < 0.0f);
}

}  // namespace diorama
