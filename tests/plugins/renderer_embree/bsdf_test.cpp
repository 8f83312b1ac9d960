// SPDX-License-Identifier: Apache-2.0
#include "bsdf.h"

#include <cmath>
#include <vector>

#include "diorama/rng.h"
#include "sobol.h"
#include "support/catch.h"

namespace diorama {
namespace {

const AlbedoTables& tables() {
  static const AlbedoTables made;
  return made;
}

Vec3f direction(float cos_theta, float phi = 0.7f) {
  const float s = std::sqrt(1.0f - cos_theta * cos_theta);
  return {s * std::cos(phi), s * std::sin(phi), cos_theta};
}

/// Share of uniform light that comes back to wo, by the BSDF's own sampling.
double furnace(const SurfaceBsdf& surface, float cos_theta) {
  static const SobolTable sobol;
  const Bsdf bsdf(surface, tables(), direction(cos_theta));
  constexpr std::uint32_t kSamples = 16384;
  double sum = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    PathSampler sampler(sobol, 11, 3, 8, i);
    const Vec2f lobe = sampler.next();
    sum += double(bsdf.sample(lobe.x(), sampler.next()).weight.mean());
  }
  return sum / kSamples;
}

const std::vector<float> kRoughnesses{0.0f, 0.1f, 0.2f, 0.35f, 0.5f, 0.7f, 0.85f, 1.0f};
const std::vector<float> kCosines{0.05f, 0.2f, 0.5f, 0.8f, 0.99f};

float alpha_of(float roughness) { return std::max(Bsdf::kMinAlpha, roughness * roughness); }

/// `least` and `most`: 16384 samples, tables of 32 x 32 (conductors) and 16 x 16 (glass).
void check_furnace(SurfaceBsdf surface, double least = 0.99, double most = 1.004) {
  for (const float roughness : kRoughnesses) {
    surface.alpha = alpha_of(roughness);
    for (const float cosine : kCosines) {
      CAPTURE(roughness, cosine, surface.metallic, surface.coat, surface.transmission);
      const double energy = furnace(surface, cosine);
      CHECK(energy >= least);
      CHECK(energy <= most);
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
  surface.specular = 0.0f;
  check_furnace(surface);
  surface.specular = 0.6f;
  surface.metallic = 0.5f;
  check_furnace(surface);
}

TEST_CASE("a clear coat takes from what lies below as much as it returns", "[bsdf][furnace]") {
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  for (const float coat_roughness : {0.1f, 0.6f}) {
    surface.coat = 1.0f;
    surface.coat_alpha = alpha_of(coat_roughness);
    // The layers' common mean comes from four points, and grazing light feels that.
    check_furnace(surface, 0.975);
  }
}

TEST_CASE("glass loses no light at every roughness, from both sides", "[bsdf][furnace]") {
  const GlassTables glass(1.5f);
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  surface.transmission = 1.0f;
  surface.glass = &glass;
  check_furnace(surface, 0.985, 1.015);
  surface.is_inside = true;
  check_furnace(surface, 0.985, 1.015);
}

TEST_CASE("light takes the same share forwards and backwards", "[bsdf]") {
  Rng rng(4);
  for (int i = 0; i < 2000; ++i) {
    SurfaceBsdf surface;
    surface.base = rng.uniform_in({Vec3::Zero(), Vec3::Ones()}).cast<float>();
    surface.metallic = float(rng.uniform());
    surface.alpha = alpha_of(float(rng.uniform(0.2, 1.0)));
    surface.specular = float(rng.uniform());
    surface.coat = rng.chance(0.5) ? float(rng.uniform()) : 0.0f;
    surface.coat_alpha = alpha_of(float(rng.uniform(0.2, 1.0)));
    const Vec3f a = direction(float(rng.uniform(0.05, 1.0)), float(rng.uniform(0.0, 6.0)));
    const Vec3f b = direction(float(rng.uniform(0.05, 1.0)), float(rng.uniform(0.0, 6.0)));
    const Vec3f forwards = Bsdf(surface, tables(), a).evaluate(b).f_cos / b.z();
    const Vec3f backwards = Bsdf(surface, tables(), b).evaluate(a).f_cos / a.z();
    for (int k = 0; k < 3; ++k)
      CHECK(forwards[k] == Approx(backwards[k]).epsilon(2e-3).margin(1e-5));
    CHECK(forwards.minCoeff() >= 0.0f);
  }
}

TEST_CASE("samples come with the density that evaluation states", "[bsdf]") {
  const GlassTables glass(1.45f);
  Rng rng(6);
  for (int i = 0; i < 60; ++i) {
    SurfaceBsdf surface;
    surface.base = Vec3f(0.8f, 0.5f, 0.3f);
    surface.metallic = i % 3 == 0 ? 0.0f : float(rng.uniform(0.0, 0.9));
    surface.alpha = alpha_of(float(rng.uniform(0.4, 1.0)));
    surface.coat = i % 2 == 0 ? 0.8f : 0.0f;
    surface.coat_alpha = alpha_of(0.5f);
    surface.transmission = i % 4 == 0 ? 0.7f : 0.0f;
    surface.glass = &glass;
    surface.is_inside = i % 8 == 0;
    const Bsdf bsdf(surface, tables(), direction(float(rng.uniform(0.2, 0.95))));
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
  const GlassTables glass(1.5f);
  SurfaceBsdf surface;
  surface.base = Vec3f::Ones();
  surface.transmission = 1.0f;
  surface.glass = &glass;
  surface.alpha = Bsdf::kMinAlpha;
  const Vec3f wo = direction(0.6f, 0.4f);
  const Bsdf bsdf(surface, tables(), wo);
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
