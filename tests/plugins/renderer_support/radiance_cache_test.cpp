// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/radiance_cache.h"

#include <algorithm>
#include <span>
#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"

namespace diorama {
namespace {

using Finding = RadianceCache::Finding;

std::vector<std::vector<Finding>> repeated(const Finding& finding, int count) {
  return {std::vector<Finding>(std::size_t(count), finding)};
}

Vec3f found(const RadianceCache& cache, const Vec3f& position, const Vec3f& normal,
            float reach = 100.0f) {
  Vec3f light;
  return cache.find(position, normal, reach, light) ? light : Vec3f(Vec3f::Constant(-1.0f));
}

RadianceCache cache_of(const Vec3f& eye, const std::vector<std::vector<Finding>>& findings) {
  const std::vector<std::span<const Finding>> parts(findings.begin(), findings.end());
  return {eye, parts};
}

const Vec3f kNothing = Vec3f::Constant(-1.0f);

}  // namespace

TEST_CASE("a cache knows the light over the albedo of what was found there", "[radiance_cache]") {
  const Vec3f eye(1.0f, -2.0f, 0.5f);
  const Vec3f up(0.1f, -0.2f, 0.97f);
  const Finding finding{eye + Vec3f(3.01f, 0.02f, -1.03f), up, 100.0f, Vec3f(0.5f, 0.25f, 0.1f),
                        Vec3f(2.0f, 3.0f, 0.05f)};
  const RadianceCache cache = cache_of(eye, repeated(finding, 100));
  CHECK(found(cache, finding.position, up).isApprox(Vec3f(4.0f, 12.0f, 0.5f)));
  // The same way up, not upside down or sideways; near, not far.
  CHECK(found(cache, finding.position, Vec3f(0.3f, 0.3f, 0.9f)).isApprox(Vec3f(4.0f, 12.0f, 0.5f)));
  CHECK(found(cache, finding.position, -up) == kNothing);
  CHECK(found(cache, finding.position, Vec3f::UnitX()) == kNothing);
  CHECK(found(cache, finding.position + Vec3f(0.0f, 9.0f, 0.0f), up) == kNothing);
}

TEST_CASE("what is seen from nearby is told by small cells, or not at all", "[radiance_cache]") {
  const Vec3f place(3.01f, 0.02f, -1.03f);
  std::vector<std::vector<Finding>> findings(1);
  // Cells next to a twenty-fifth of 3.2 m: an eighth.
  for (int i = 0; i < 100; ++i) {
    const Vec3f off(0.0f, 0.001f * float(i), 0.0f);
    findings[0].push_back({place + off, Vec3f::UnitZ(), 0.5f, Vec3f::Ones(), Vec3f::Ones()});
    // Found from too close by: it counts for nobody.
    findings[0].push_back(
        {place + off, Vec3f::UnitZ(), 0.05f, Vec3f::Ones(), Vec3f::Constant(50.0f)});
  }
  const RadianceCache cache = cache_of(Vec3f::Zero(), findings);
  CHECK(found(cache, place, Vec3f::UnitZ(), 0.3f) == Vec3f::Ones());
  CHECK(found(cache, place, Vec3f::UnitZ(), 0.1f) == kNothing);
}

TEST_CASE("a cache believes only what was found often enough", "[radiance_cache]") {
  const Finding finding{Vec3f(2.0f, 1.0f, 0.5f), Vec3f::UnitY(), 100.0f, Vec3f::Ones(),
                        Vec3f::Ones()};
  CHECK(found(RadianceCache(Vec3f::Zero(), {}), finding.position, finding.normal) == kNothing);
  for (const int count : {1, 20}) {
    const RadianceCache cache = cache_of(Vec3f::Zero(), repeated(finding, count));
    CHECK(found(cache, finding.position, finding.normal) == kNothing);
  }
}

TEST_CASE("where little was found, wider cells answer", "[radiance_cache]") {
  // A floor of which one end is looked at often, the other one seldom.
  Rng rng(5);
  std::vector<std::vector<Finding>> findings(3);
  const auto light_at = [](double x) { return float(x < 0.0 ? 1.0 : 3.0); };
  for (int i = 0; i < 30'000; ++i) {
    const bool is_dense = i % 100 != 0;
    const double x = is_dense ? rng.uniform(-2.0, 0.0) : rng.uniform(0.0, 2.0);
    findings[std::size_t(i % 3)].push_back({Vec3f(float(x), float(rng.uniform(4.0, 5.0)), 0.0f),
                                            Vec3f::UnitZ(), 100.0f, Vec3f::Constant(0.5f),
                                            Vec3f::Constant(light_at(x))});
  }
  const RadianceCache cache = cache_of(Vec3f(0.0f, 0.0f, 1.5f), findings);
  int far_known = 0;
  for (int i = 0; i < 200; ++i) {
    const double x = rng.uniform(0.3, 2.0);
    const Vec3f dense = found(cache, Vec3f(float(-x), 4.5f, 0.0f), Vec3f::UnitZ());
    CHECK(dense.x() == Approx(2.0f));
    const Vec3f sparse = found(cache, Vec3f(float(x), 4.5f, 0.0f), Vec3f::UnitZ());
    if (sparse != kNothing) {
      ++far_known;
      // Cells are cubes at multiples of their width: none holds both ends.
      CHECK(sparse.x() == Approx(6.0f));
    }
  }
  CHECK(far_known > 150);
}

TEST_CASE("cells grow with the distance from the eye", "[radiance_cache]") {
  // Stripes of light one metre wide: plain from nearby, a mean of them from far away.
  Rng rng(7);
  std::vector<std::vector<Finding>> findings(1);
  for (int i = 0; i < 400'000; ++i) {
    const double x = rng.uniform(0.0, 64.0);
    const bool is_lit = (int(x) & 1) != 0;
    findings[0].push_back({Vec3f(float(x), 0.0f, 0.0f), Vec3f::UnitZ(), 100.0f, Vec3f::Ones(),
                           Vec3f::Constant(is_lit ? 2.0f : 0.0f)});
  }
  const Vec3f lit(31.5f, 0.0f, 0.0f);
  const RadianceCache near = cache_of(Vec3f(31.5f, 0.0f, 3.0f), findings);
  CHECK(found(near, lit, Vec3f::UnitZ()).x() == Approx(2.0f));
  const RadianceCache far = cache_of(Vec3f(31.5f, 0.0f, 900.0f), findings);
  CHECK(found(far, lit, Vec3f::UnitZ()).x() == Approx(1.0f).margin(0.1));
}

TEST_CASE("what is met seldom keeps its light beside what is met often", "[radiance_cache]") {
  // A dim floor that is looked at often and a bright step in it that is not: all light together
  // stays what it was, as each finding counts where an equal question is answered.
  Rng rng(11);
  std::vector<std::vector<Finding>> findings(1);
  double light = 0.0;
  for (int i = 0; i < 20'000; ++i) {
    const bool is_step = i % 200 == 0;
    const double x = is_step ? rng.uniform(0.0, 0.2) : rng.uniform(-1.0, 0.0);
    const float brightness = is_step ? 200.0f : 1.0f;
    findings[0].push_back({Vec3f(float(x), float(rng.uniform(2.9, 3.1)), 0.0f), Vec3f::UnitZ(),
                           100.0f, Vec3f::Constant(0.5f), Vec3f::Constant(brightness)});
    light += double(brightness);
  }
  const RadianceCache cache = cache_of(Vec3f(0.0f, 0.0f, 1.5f), findings);
  double found_light = 0.0;
  for (const Finding& finding : findings[0]) {
    const Vec3f answer = found(cache, finding.position, finding.normal, finding.reach);
    // Where nothing is known, whole paths find it.
    found_light += double(answer == kNothing ? finding.light.x() : answer.x() * 0.5f);
  }
  CHECK(found_light == Approx(light).epsilon(1e-3));
}

TEST_CASE("equal findings make equal tables, whatever parts they came in", "[radiance_cache]") {
  Rng rng(3);
  std::vector<Finding> all;
  for (int i = 0; i < 20'000; ++i) {
    const auto number = [&] { return float(rng.uniform(-3.0, 3.0)); };
    all.push_back({Vec3f(number(), number(), number()), Vec3f(number(), number(), number()), 100.0f,
                   Vec3f::Constant(0.5f), Vec3f(number(), number(), number()).cwiseAbs()});
  }
  const std::vector<std::vector<Finding>> in_one{all};
  const std::vector<std::vector<Finding>> in_three{
      {all.begin(), all.begin() + 77}, {}, {all.begin() + 77, all.end()}};
  const RadianceCache one = cache_of(Vec3f(0.3f, 0.2f, 0.1f), in_one);
  const RadianceCache three = cache_of(Vec3f(0.3f, 0.2f, 0.1f), in_three);
  REQUIRE(one.table().size() == three.table().size());
  std::size_t known = 0;
  for (std::size_t i = 0; i < one.table().size(); ++i) {
    CHECK(one.table()[i].key == three.table()[i].key);
    CHECK(one.table()[i].light == three.table()[i].light);
    known += one.table()[i].key != 0 ? 1 : 0;
  }
  CHECK(known > 50);
  CHECK(2 * known <= one.table().size());
}

}  // namespace diorama
