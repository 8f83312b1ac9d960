// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/light_samples.h"

#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

Affine pose() {
  Transform t;
  t.translation = Vec3(0.4, -0.3, 2.2);
  t.rotation = Quat(Eigen::AngleAxisd(0.3, Vec3(0.6, 0.8, 0.0)));
  t.scale = Vec3(1.2, 1.2, 1.2);
  return t.affine();
}

EmittingTriangles square(double half, const Affine& world_from_node) {
  EmittingTriangles source;
  const auto p = [&](double x, double y) {
    return Vec3f((world_from_node * Vec3(x * half, y * half, 0.0)).cast<float>());
  };
  // Facing -z.
  source.triangles = {{p(-1, -1), p(1, 1) - p(-1, -1), p(1, -1) - p(-1, -1), 0},
                      {p(-1, -1), p(-1, 1) - p(-1, -1), p(1, 1) - p(-1, -1), 1}};
  source.is_double_sided = false;
  source.mean_radiance = Vec3f::Constant(3.0f);
  return source;
}

std::shared_ptr<const DomeTexture> white_sky() {
  static const Texture texture = [] {
    Texture white;
    white.width = 64;
    white.height = 32;
    white.channels = 1;
    white.floats.assign(64 * 32, 1.0f);
    return white;
  }();
  return std::make_shared<const DomeTexture>(texture);
}

std::vector<Light> every_kind() {
  std::vector<Light> lights(5);
  lights[0].kind = LightKind::Sphere;
  lights[0].radius_m = 0.4;
  lights[1].kind = LightKind::Rect;
  lights[1].width_m = 0.7;
  lights[1].height_m = 1.1;
  lights[2].kind = LightKind::Disk;
  lights[2].radius_m = 0.5;
  lights[3].kind = LightKind::Distant;
  lights[3].angle_rad = 0.4;
  lights[4].kind = LightKind::Dome;
  for (Light& light : lights) light.color = Vec3f(3.0f, 2.0f, 1.0f);
  return lights;
}

/// What one place gets; fills its total_score.
struct Chosen {
  std::uint32_t light = 0;
  float probability = 0.0f;
};
Chosen choose(const LightTable& lights, Receiver& receiver, float u) {
  LightQueries queries;
  queries.count = 1;
  queries.position.set(0, receiver.position);
  queries.normal.set(0, receiver.normal);
  queries.is_two_sided[0] = receiver.is_two_sided;
  queries.u[0] = u;
  LightSelections selections;
  choose_lights(lights, queries, selections);
  receiver.total_score = selections.total_score[0];
  return {std::uint32_t(selections.light[0]), selections.probability[0]};
}

/// A point of one light, as one place gets it.
struct Sampled {
  Vec3f direction;
  float density = 0.0f;
  Vec3f radiance;
};
Sampled sample(const LightTable& lights, const Vec3f& from, const Vec2f& u) {
  LightQueries queries;
  queries.count = 1;
  queries.position.set(0, from);
  LightSelections selections;
  selections.probability[0] = 1.0f;
  BatchFloats x{};
  BatchFloats y{};
  x[0] = u.x();
  y[0] = u.y();
  LightSamples samples;
  sample_lights(lights, queries, selections, x, y, samples);
  const Vec3f direction = samples.direction.at(0);
  return {direction, samples.density[0], lights.radiance_of(samples.place(0), direction)};
}

}  // namespace
TEST_CASE("a ray towards a light sample meets that light with the same density", "[lights]") {
  const Vec3f from(0.1f, 0.2f, 0.3f);
  Rng rng(12);
  for (const Light& light : every_kind()) {
    LightTable lights;
    lights.add(light, pose(), white_sky());
    lights.finish();
    for (int i = 0; i < 500; ++i) {
      const Sampled s = sample(lights, from, {float(rng.uniform()), float(rng.uniform())});
      REQUIRE(s.density > 0.0f);
      int met = 0;
      lights.along_ray(from, s.direction, 0.0f, std::numeric_limits<float>::infinity(), false,
                       [&](std::uint32_t, const Vec3f& radiance, float density) {
                         ++met;
                         CHECK(density == Approx(s.density).epsilon(2e-3));
                         CHECK((radiance - s.radiance).norm() < 1e-4f);
                       });
      if (i > 3) CHECK(met <= 1);
      // Samples on the very rim may miss by rounding; none may do so in numbers.
      if (met == 0) CHECK(i % 50 != 0);
    }
  }
}

TEST_CASE("a batch of places gets what each would get alone, and its rays meet the same lights",
          "[lights]") {
  LightTable lights;
  for (const Light& light : every_kind()) lights.add(light, pose(), white_sky());
  lights.add(square(0.4, pose()));
  lights.finish();
  Rng rng(3);
  LightQueries queries;
  LightSelections selections;
  BatchFloats u{};
  BatchFloats v{};
  queries.count = 61;
  for (std::size_t i = 0; i < queries.count; ++i) {
    queries.position.set(i, {float(rng.uniform()), float(rng.uniform()), float(rng.uniform())});
    selections.light[i] = std::int32_t(i % lights.count());
    selections.probability[i] = i % 5 == 4 ? 0.0f : 0.5f;
    u[i] = float(rng.uniform());
    v[i] = float(rng.uniform());
  }
  LightSamples samples;
  sample_lights(lights, queries, selections, u, v, samples);
  BatchInts may_hit{};
  lights.find_near(queries.count, queries.position, samples.direction, may_hit);
  for (std::size_t i = 0; i < queries.count; ++i) {
    CAPTURE(i);
    if (selections.probability[i] == 0.0f) {
      CHECK(samples.density[i] == 0.0f);
      continue;
    }
    LightQueries one;
    one.count = 1;
    one.position.set(0, queries.position.at(i));
    LightSelections chosen;
    chosen.light[0] = selections.light[i];
    chosen.probability[0] = 0.5f;
    BatchFloats own_u{};
    BatchFloats own_v{};
    own_u[0] = u[i];
    own_v[0] = v[i];
    LightSamples alone;
    sample_lights(lights, one, chosen, own_u, own_v, alone);
    CHECK(alone.density[0] == samples.density[i]);
    CHECK(alone.distance[0] == samples.distance[i]);
    CHECK(alone.direction.at(0) == samples.direction.at(i));
    int bodies = 0;
    lights.along_ray(queries.position.at(i), samples.direction.at(i), 0.0f, 1e6f, false,
                     [&](std::uint32_t, const Vec3f&, float) { ++bodies; });
    if (bodies > 0) CHECK(may_hit[i] != 0);
  }
}

TEST_CASE("the density of every light integrates to one", "[lights]") {
  const Vec3f from(0.1f, 0.2f, 0.3f);
  Rng rng(13);
  for (const Light& light : every_kind()) {
    LightTable lights;
    lights.add(light, pose(), white_sky());
    lights.finish();
    double sum = 0.0;
    constexpr int kSamples = 400000;
    for (int i = 0; i < kSamples; ++i) {
      const Vec3f d = uniform_sphere({float(rng.uniform()), float(rng.uniform())});
      lights.along_ray(from, d, 0.0f, std::numeric_limits<float>::infinity(), false,
                       [&](std::uint32_t, const Vec3f&, float density) {
                         sum += double(density) * 4.0 * kPi / kSamples;
                       });
    }
    CAPTURE(int(light.kind));
    CHECK(sum == Approx(1.0).epsilon(0.04));
  }
}

TEST_CASE("lights are chosen as often as their probability says", "[lights]") {
  LightTable lights;
  for (const Light& light : every_kind()) lights.add(light, pose(), white_sky());
  lights.add(square(0.4, pose()));
  lights.finish();
  Receiver receiver{Vec3f(0.2f, 0.5f, -0.4f), Vec3f(0.2f, 0.1f, 0.97f).normalized(), false, 0.0f};
  std::vector<double> counts(lights.count(), 0.0);
  constexpr int kSamples = 200000;
  for (int i = 0; i < kSamples; ++i) {
    const Chosen choice = choose(lights, receiver, (float(i) + 0.5f) / float(kSamples));
    CHECK(choice.probability ==
          Approx(choice_probability(lights, choice.light, receiver)).epsilon(1e-4));
    counts[choice.light] += 1.0 / kSamples;
  }
  double total = 0.0;
  for (std::uint32_t i = 0; i < lights.count(); ++i) {
    CHECK(counts[i] == Approx(choice_probability(lights, i, receiver)).margin(2e-3));
    CHECK(counts[i] > 0.0);
    total += double(choice_probability(lights, i, receiver));
  }
  CHECK(total == Approx(1.0).epsilon(1e-4));
}

TEST_CASE("a distant light is chosen where it is seen", "[lights]") {
  Light sun;
  sun.kind = LightKind::Distant;
  sun.angle_rad = 0.01;
  sun.color = Vec3f::Constant(300.0f);
  Light sky;
  sky.kind = LightKind::Dome;
  LightTable lights;
  for (const Light& light : {sun, sky}) lights.add(light, pose(), white_sky());
  lights.finish();
  test::RenderHost host(2);
  const Aabb bounds{Vec3(-3, -3, -1.5), Vec3(3, 3, 1.5)};
  const auto sees = [](std::span<const CellGrid::Ray> rays) {
    std::uint32_t lit = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) lit |= std::uint32_t(rays[i].origin.x() > 0) << i;
    return lit;
  };
  lights.learn_surroundings(
      [](const std::shared_ptr<const DomeTexture>& dome, const Eigen::Matrix3f&) {
        return std::make_shared<const SkyGrid>(*dome);
      },
      [&](const Vec3f& towards, float one_minus_cos) {
        CHECK((towards + lights.records()[0].direction).norm() < 1e-6f);
        return std::make_shared<const SunGrid>(towards, one_minus_cos, bounds, sees, host);
      });
  const Vec3f facing = -lights.records()[0].direction;
  const auto probability = [&](float x) {
    Receiver receiver{Vec3f(x, 0.4f, 0.2f), facing, false, 0.0f};
    constexpr int kSamples = 20000;
    int suns = 0;
    for (int i = 0; i < kSamples; ++i) {
      const Chosen chosen = choose(lights, receiver, (float(i) + 0.5f) / kSamples);
      suns += chosen.light == 0 ? 1 : 0;
      CHECK(chosen.probability ==
            Approx(choice_probability(lights, chosen.light, receiver)).epsilon(1e-4));
    }
    const double told = double(choice_probability(lights, 0, receiver));
    CHECK(double(suns) / kSamples == Approx(told).margin(1e-3));
    return told;
  };
  // Of a white sky all around, 4 pi.
  CHECK(probability(2.0f) == Approx(300.0 / (300.0 + 4.0 * kPi)).epsilon(0.02));
  const double unseen = 300.0 * double(CellGrid::kUnseenShare);
  CHECK(probability(-2.0f) == Approx(unseen / (unseen + 4.0 * kPi)).epsilon(0.02));
}

TEST_CASE("places that ask together get the lights that they get alone", "[lights]") {
  LightTable lights;
  for (int i = 0; i < 5; ++i) {
    for (const Light& light : every_kind()) {
      lights.add(light, Affine(Eigen::Translation3d(i, 0.5 * i, 0.0)) * pose(), white_sky());
    }
  }
  lights.finish();
  Rng rng(4);
  LightQueries queries;
  queries.count = 13;
  for (std::size_t i = 0; i < queries.count; ++i) {
    queries.position.set(i, rng.uniform_in({Vec3(0, 0, 0), Vec3(5, 5, 1)}).cast<float>());
    queries.normal.set(i, Vec3(rng.uniform_rotation() * Vec3::UnitZ()).cast<float>());
    queries.is_two_sided[i] = i % 3 == 0;
    queries.u[i] = float(rng.uniform());
  }
  LightSelections together;
  choose_lights(lights, queries, together);
  for (std::size_t i = 0; i < queries.count; ++i) {
    Receiver alone = queries.receiver(i);
    const Chosen chosen = choose(lights, alone, queries.u[i]);
    CHECK(std::uint32_t(together.light[i]) == chosen.light);
    CHECK(together.probability[i] == chosen.probability);
    CHECK(together.total_score[i] == alone.total_score);
  }
}

TEST_CASE("hundreds of lights are chosen as often as their probability says", "[lights]") {
  Rng rng(21);
  LightTable lights;
  for (int i = 0; i < 300; ++i) {
    Light lamp;
    lamp.kind = i % 3 == 0 ? LightKind::Disk : LightKind::Sphere;
    lamp.radius_m = rng.uniform(0.02, 0.2);
    lamp.color = Vec3f::Constant(float(rng.uniform(0.5, 5.0)));
    const Vec3 at = rng.uniform_in({Vec3(-5, -4, 1), Vec3(5, 6, 3)});
    lights.add(lamp, Affine(Eigen::Translation3d(at)), nullptr);
  }
  lights.add(every_kind()[4], pose(), white_sky());
  lights.finish();
  Receiver receiver{Vec3f(0.3f, 0.7f, 0.4f), Vec3f(0.3f, 0.2f, 0.9f).normalized(), false, 0.0f};
  std::vector<double> counts(lights.count(), 0.0);
  constexpr int kSamples = 400000;
  int mismatches = 0;
  double missed = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    const Chosen choice = choose(lights, receiver, (float(i) + 0.5f) / float(kSamples));
    if (choice.probability == 0.0f) {  // a group whose lights all turn out to face away
      missed += 1.0 / kSamples;
      continue;
    }
    const float again = choice_probability(lights, choice.light, receiver);
    mismatches += std::abs(again / choice.probability - 1.0f) > 1e-3f;
    counts[choice.light] += 1.0 / kSamples;
  }
  CHECK(mismatches == 0);
  double total = 0.0;
  for (std::uint32_t i = 0; i < lights.count(); ++i) {
    const double p = double(choice_probability(lights, i, receiver));
    CHECK(counts[i] == Approx(p).margin(1e-4).epsilon(0.02));
    total += p;
  }
  CHECK(total + missed == Approx(1.0).epsilon(1e-3));
}

TEST_CASE("a lamp taken as a turning disk gives a near point less light", "[lights]") {
  Light lamp;
  lamp.radius_m = 0.5;
  lamp.color = Vec3f::Constant(3.0f);
  LightTable lights(true);
  lights.add(lamp, Affine(Eigen::Translation3d(0, 0, 1.3)), nullptr);
  lights.finish();
  Rng rng(5);
  double sum = 0.0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const Sampled s = sample(lights, Vec3f::Zero(), {float(rng.uniform()), float(rng.uniform())});
    REQUIRE(s.density > 0.0f);
    sum += double(s.radiance.x() * s.direction.z() / s.density) / kSamples;
    float met = 0.0f;
    lights.along_ray(Vec3f::Zero(), s.direction, 0.0f, std::numeric_limits<float>::infinity(),
                     false, [&](std::uint32_t, const Vec3f&, float density) { met = density; });
    if (i % 100 == 0) CHECK(met == Approx(s.density).epsilon(2e-3));
  }
  CHECK(sum == Approx(kPi * 3.0 * 0.25 / (0.25 + 1.69)).epsilon(0.005));
}

TEST_CASE("a light below the horizon or turned away is never chosen", "[lights]") {
  Light lamp;
  lamp.kind = LightKind::Disk;
  lamp.radius_m = 0.2;
  LightTable lights;
  lights.add(lamp, Affine(Eigen::Translation3d(0, 0, 1)), nullptr);  // shines along -z
  lights.finish();
  Receiver below{Vec3f::Zero(), Vec3f::UnitZ(), false, 0.0f};
  CHECK(choose(lights, below, 0.5f).probability == 1.0f);
  Receiver facing_away{Vec3f::Zero(), -Vec3f::UnitZ(), false, 0.0f};
  CHECK(choose(lights, facing_away, 0.5f).probability == 0.0f);
  Receiver above{Vec3f(0, 0, 2), -Vec3f::UnitZ(), false, 0.0f};
  CHECK(choose(lights, above, 0.5f).probability == 0.0f);
}

TEST_CASE("the light that falls on a point is that of the closed forms", "[lights]") {
  // A surface at the origin facing +z, lights above it shining down.
  const auto irradiance = [](const LightTable& lights) {
    Rng rng(8);
    double sum = 0.0;
    constexpr int kSamples = 100000;
    for (int i = 0; i < kSamples; ++i) {
      const Sampled s = sample(lights, Vec3f::Zero(), {float(rng.uniform()), float(rng.uniform())});
      if (s.density <= 0.0f || s.direction.z() <= 0.0f) continue;
      const float density = std::isinf(s.density) ? 1.0f : s.density;
      sum += double(s.radiance.x() * s.direction.z() / density) / kSamples;
    }
    return sum;
  };
  const auto make = [](const Light& light, const Affine& at) {
    LightTable lights;
    lights.add(light, at, white_sky());
    lights.finish();
    return lights;
  };
  Light light;
  light.color = Vec3f::Constant(3.0f);
  const Affine above(Eigen::Translation3d(0.6, -0.3, 1.7));
  const double d2 = 0.6 * 0.6 + 0.3 * 0.3 + 1.7 * 1.7;

  light.kind = LightKind::Sphere;
  light.radius_m = 0.5;
  CHECK(irradiance(make(light, above)) ==
        Approx(kPi * 3.0 * 0.25 / d2 * 1.7 / std::sqrt(d2)).epsilon(0.005));

  light.kind = LightKind::Disk;
  light.radius_m = 0.8;
  CHECK(irradiance(make(light, Affine(Eigen::Translation3d(0, 0, 1.3)))) ==
        Approx(kPi * 3.0 * 0.64 / (0.64 + 1.69)).epsilon(0.01));

  // A rectangle a x b with a corner straight above the point (Siegel and Howell, configuration
  // factors); this one has its centre there, so four corners.
  const auto rect_above = [](double w, double h, double z) {
    const double a = w / 2 / z;
    const double b = h / 2 / z;
    const double ra = std::sqrt(1 + a * a);
    const double rb = std::sqrt(1 + b * b);
    return 4.0 / (2 * kPi) * (a / ra * std::atan(b / ra) + b / rb * std::atan(a / rb));
  };
  light.kind = LightKind::Rect;
  light.width_m = 1.5;
  light.height_m = 0.9;
  CHECK(irradiance(make(light, Affine(Eigen::Translation3d(0, 0, 1.2)))) ==
        Approx(kPi * 3.0 * rect_above(1.5, 0.9, 1.2)).epsilon(0.01));

  LightTable emitting;
  emitting.add(square(0.6, Affine(Eigen::Translation3d(0, 0, 1.2))));
  emitting.finish();
  CHECK(irradiance(emitting) == Approx(kPi * 3.0 * rect_above(1.2, 1.2, 1.2)).epsilon(0.01));

  light.kind = LightKind::Distant;
  const Affine tilted(Eigen::AngleAxisd(0.5, Vec3::UnitX()));
  for (const double angle : {0.0, 0.01, 0.6}) {
    light.angle_rad = angle;
    CHECK(irradiance(make(light, tilted)) == Approx(3.0 * std::cos(0.5)).epsilon(0.005));
  }

  light.kind = LightKind::Dome;
  CHECK(irradiance(make(light, pose())) == Approx(kPi * 3.0).epsilon(0.01));
}

TEST_CASE("a cone keeps light to its inside", "[lights]") {
  Light spot;
  spot.kind = LightKind::Sphere;
  spot.radius_m = 0.05;
  spot.cone_angle_rad = 0.5;
  spot.cone_softness = 0.2;
  LightTable lights;
  lights.add(spot, Affine(Eigen::Translation3d(0, 0, 2)), nullptr);
  lights.finish();
  const auto at_angle = [&](double angle) {
    const Vec3f from(float(2.0 * std::tan(angle)), 0.0f, 0.0f);
    return sample(lights, from, {0.5f, 0.5f}).radiance.x();
  };
  CHECK(at_angle(0.3) == 1.0f);
  CHECK(at_angle(0.45) > 0.05f);
  CHECK(at_angle(0.45) < 0.95f);
  CHECK(at_angle(0.55) == 0.0f);
}

TEST_CASE("a dome's image lies as the scene format says", "[lights]") {
  // Top row +z; centre column +x; the right half towards -y.
  auto texture = std::make_shared<Texture>();
  texture->width = 8;
  texture->height = 4;
  texture->channels = 3;
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      texture->floats.push_back(y == 0 ? 1.0f : 0.0f);
      texture->floats.push_back(x == 6 ? 1.0f : 0.0f);  // a quarter to the right of the centre
      texture->floats.push_back(x == 3 || x == 4 ? 1.0f : 0.0f);
    }
  }
  const DomeTexture dome(*texture);
  const auto seen = [&](const Vec3f& direction) { return dome.place(direction).radiance; };
  CHECK(seen(Vec3f(0.01f, 0, 1).normalized()).x() > 0.9f);
  CHECK(seen(Vec3f(0.01f, 0, -1).normalized()).x() < 0.1f);
  CHECK(seen(Vec3f::UnitX()).z() > 0.9f);
  CHECK(seen(-Vec3f::UnitX()).z() < 0.1f);
  CHECK(seen(-Vec3f::UnitY()).y() > 0.4f);
  CHECK(seen(Vec3f::UnitY()).y() < 0.1f);
}

}  // namespace diorama
