// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "diorama/error.h"
#include "embree_renderer.h"
#include "path_tracer.h"
#include "renderer_support/sample_plan.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"

namespace diorama {
namespace {

using test::at;
using test::dome;
using test::inside_out;
using test::matte;
using test::RenderHost;
using test::TestWorld;

EmbreeRenderer::Params reference(int samples, int bounces = 6) {
  EmbreeRenderer::Params params;
  params.samples = samples;
  params.max_bounces = bounces;
  params.denoise = false;
  params.caustics = true;
  params.exposure = "fixed";
  params.view_transform = "standard";
  return params;
}

Image<Vec3f> render(TestWorld& world, NodeId camera, const EmbreeRenderer::Params& params,
                    int threads = 2, std::uint64_t seed = 3) {
  RenderHost host(threads);
  EmbreeRenderer renderer(params, host);
  renderer.prepare(world.scene);
  return renderer.render({camera, {std::string(kColorHdr.name)}, seed}).get(kColorHdr);
}

struct Statistics {
  double mean = 0.0;
  double error = 0.0;  ///< Standard error of the mean.
};

Statistics statistics(const Image<Vec3f>& image) {
  double sum = 0.0;
  double sum2 = 0.0;
  const double n = double(image.pixels().size());
  for (const Vec3f& p : image.pixels()) {
    const double v = double(p.mean());
    sum += v;
    sum2 += v * v;
  }
  const double mean = sum / n;
  return {mean, std::sqrt(std::max(0.0, sum2 / n - mean * mean) / n)};
}

/// A room with shiny, rough, clear and glowing things under lights of every kind.
TestWorld busy_room() {
  TestWorld world;
  const Mesh room = inside_out(make_box(Vec3(5, 4, 3)));
  world.add("room", room, matte(0.6f));
  Material metal;
  metal.base_color = Vec3f(0.9f, 0.7f, 0.3f);
  metal.metallic = 1.0f;
  metal.roughness = 0.3f;
  world.add("ball", make_sphere(0.5), metal, at(0.8, 0.5, -0.9));
  Material coated;
  coated.base_color = Vec3f(0.7f, 0.1f, 0.1f);
  coated.clearcoat = 1.0f;
  coated.clearcoat_roughness = 0.2f;
  world.add("box", make_box(Vec3(0.7, 0.6, 0.9)), coated, at(-0.9, 0.7, -1.0));
  Material glow;
  glow.base_color = Vec3f::Constant(0.2f);
  glow.emission = Vec3f(2.0f, 4.0f, 6.0f);
  world.add("glow", make_cylinder(0.2, 0.5), glow, at(0.0, 1.2, -1.1));
  Light lamp;
  lamp.radius_m = 0.15;
  lamp.color = Vec3f(30.0f, 25.0f, 20.0f);
  world.add(lamp, at(-1.2, -0.8, 1.0));
  Light panel;
  panel.kind = LightKind::Rect;
  panel.width_m = 1.2;
  panel.height_m = 0.7;
  panel.color = Vec3f(4.0f, 4.0f, 5.0f);
  world.add(panel, at(1.0, 0.3, 1.3));
  return world;
}

}  // namespace

TEST_CASE("nothing is seen of any object in a white furnace", "[renderer][furnace][long]") {
  const std::vector<std::pair<const char*, std::function<void(Material&)>>> materials{
      {"matte", [](Material& m) { m.specular = 0.0f; }},
      {"plastic", [](Material& m) { m.roughness = 0.3f; }},
      {"metal", [](Material& m) { m.metallic = 1.0f, m.roughness = 0.8f; }},
      {"coated", [](Material& m) { m.clearcoat = 1.0f; }},
      {"glass", [](Material& m) { m.transmission = 1.0f, m.roughness = 0.0f; }},
      {"frosted", [](Material& m) { m.transmission = 1.0f, m.roughness = 0.6f; }},
      {"pane", [](Material& m) { m.transmission = 1.0f, m.is_thin_walled = true; }},
      {"veil", [](Material& m) { m.opacity = 0.4f; }},
  };
  for (const auto& [name, change] : materials) {
    TestWorld world;
    Material material;
    material.base_color.setOnes();
    change(material);
    world.add("ball", make_sphere(1.0, 96), material, at(0.1, 0.2, -0.1));
    world.add(dome(1.0f));
    const NodeId camera = world.add_camera(24, 20, 20.0, Vec3(3, -2, 1), Vec3(0.1, 0.2, -0.1));
    const Statistics s = statistics(render(world, camera, reference(128, 64)));
    CAPTURE(name);
    CHECK(s.mean > 0.99);
    CHECK(s.mean < 1.003);
  }
}

TEST_CASE("a scene without any light is black", "[renderer]") {
  TestWorld world;
  Material metal;
  metal.metallic = 1.0f;
  metal.roughness = 0.2f;
  world.add("ball", make_sphere(1.0), metal);
  world.add("floor", make_plane(5, 4), matte(0.5f), at(0, 0, -1.1));
  const NodeId camera = world.add_camera(24, 20, 20.0, Vec3(3, -2, 1), Vec3(0.1, 0.2, -0.1));
  const Image<Vec3f> picture = render(world, camera, reference(4));
  for (const Vec3f& p : picture.pixels()) REQUIRE(p.isZero());
}

TEST_CASE("a lamp over a floor lights it by the closed form", "[renderer]") {
  TestWorld world;
  world.add("floor", make_plane(4, 5), matte(0.5f));
  Light lamp;
  lamp.radius_m = 0.3;
  lamp.color = Vec3f(20.0f, 10.0f, 5.0f);
  lamp.is_visible_to_camera = false;
  world.add(lamp, at(0.4, -0.2, 1.5));
  // A narrow view of the point (0.1, 0.3, 0).
  const NodeId camera = world.add_camera(16, 12, 4000.0, Vec3(-2, 1, 2), Vec3(0.1, 0.3, 0));
  const Image<Vec3f> image = render(world, camera, reference(64));
  Vec3 mean = Vec3::Zero();
  for (const Vec3f& p : image.pixels()) mean += p.cast<double>() / double(image.pixels().size());
  const double d2 = 0.3 * 0.3 + 0.5 * 0.5 + 1.5 * 1.5;
  const double per_radiance = 0.5 * 0.3 * 0.3 / d2 * 1.5 / std::sqrt(d2);
  CHECK(mean.x() == Approx(20.0 * per_radiance).epsilon(0.005));
  CHECK(mean.y() == Approx(10.0 * per_radiance).epsilon(0.005));
  CHECK(mean.z() == Approx(5.0 * per_radiance).epsilon(0.005));
}

TEST_CASE("a closed lamp is sampled where it faces what it lights", "[renderer][lights]") {
  const bool is_double_sided = GENERATE(false, true);
  const bool is_inside_out = GENERATE(false, true);
  const bool is_mirrored = GENERATE(false, true);
  CAPTURE(is_double_sided, is_inside_out, is_mirrored);
  TestWorld world;
  world.add("floor", make_plane(4, 5), matte(0.5f));
  Mesh ball = make_sphere(0.3, 64);
  ball.is_double_sided = is_double_sided;
  if (is_inside_out) {
    for (auto& t : ball.triangles) std::swap(t[1], t[2]);
  }
  Material glow = matte(0.0f);
  glow.emission = Vec3f(20.0f, 10.0f, 5.0f);
  Affine pose = at(0.4, -0.2, 1.5);
  if (is_mirrored) pose.linear().col(1) *= -1.0;
  world.add("lamp", ball, glow, pose);
  const NodeId camera = world.add_camera(40, 30, 4000.0, Vec3(-2, 1, 2), Vec3(0.1, 0.3, 0));
  const Image<Vec3f> image = render(world, camera, reference(1));
  double mean = 0.0;
  double squares = 0.0;
  const double pixels = double(image.pixels().size());
  for (const Vec3f& p : image.pixels()) {
    mean += double(p.x()) / pixels;
    squares += double(p.x()) * double(p.x()) / pixels;
  }
  if (is_inside_out && !is_double_sided) {
    CHECK(mean == 0.0);
    return;
  }
  const double d2 = 0.3 * 0.3 + 0.5 * 0.5 + 1.5 * 1.5;
  const double per_radiance = 0.5 * 0.3 * 0.3 / d2 * 1.5 / std::sqrt(d2);
  CHECK(mean == Approx(20.0 * per_radiance).epsilon(0.02));
  // Points drawn evenly over the whole ball spread by more than 1.3 of their mean.
  CHECK(std::sqrt(squares - mean * mean) < mean);
}

TEST_CASE("a panel with a picture lights a floor by the closed form", "[renderer]") {
  // Brighter towards one corner: the halves of the panel shine unlike each other.
  constexpr int kTexels = 8;
  auto picture = std::make_shared<Texture>();
  picture->width = picture->height = kTexels;
  picture->channels = 1;
  for (int y = 0; y < kTexels; ++y) {
    for (int x = 0; x < kTexels; ++x) picture->floats.push_back(float(x + 2 * y));
  }
  const auto brightness = [](double u, double v) {
    return std::clamp(kTexels * u - 0.5, 0.0, kTexels - 1.0) +
           2.0 * std::clamp(kTexels * (1.0 - v) - 0.5, 0.0, kTexels - 1.0);
  };
  Material glow = matte(0.0f);
  glow.emission.setOnes();
  glow.emission_texture.texture = picture;
  glow.emission_texture.wrap_u = glow.emission_texture.wrap_v = Wrap::Clamp;
  TestWorld world;
  world.add("floor", make_plane(6, 6), matte(0.5f));
  Affine overhead = at(0.3, -0.2, 0.8);
  overhead.linear() = Mat3(Eigen::AngleAxisd(kPi, Vec3::UnitX()));
  world.add("panel", make_plane(1.2, 0.9), glow, overhead);

  const Vec3 place = GENERATE(Vec3(0.8, 0.2, 0.0), Vec3(-0.4, -0.7, 0.0));
  constexpr int kSteps = 200;
  double expected = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double u = (i + 0.5) / kSteps;
      const double v = (j + 0.5) / kSteps;
      const Vec3 to = overhead * Vec3(1.2 * (u - 0.5), 0.9 * (v - 0.5), 0.0) - place;
      const double cosines = to.z() * to.z() / to.squaredNorm();
      expected += brightness(u, v) * cosines / to.squaredNorm();
    }
  }
  expected *= 0.5 / kPi * 1.2 * 0.9 / (kSteps * kSteps);
  const NodeId camera = world.add_camera(8, 6, 2000.0, place + Vec3(1.4, 0.9, 0.6), place);
  CHECK(statistics(render(world, camera, reference(512))).mean == Approx(expected).epsilon(0.02));
}

TEST_CASE("a floor whose white stripes alone are in the sun lights a wall by the closed form",
          "[renderer]") {
  // Where paths read the floor's texture as widely as they spread, black and white are one grey.
  constexpr int kStripes = 8;
  constexpr int kTexels = 32;  // Of a stripe.
  constexpr double kSide = 2.0;
  constexpr double kWidth = kSide / kStripes;
  const auto middle = [](int stripe) { return (stripe + 0.5) * kWidth - 0.5 * kSide; };
  auto stripes = std::make_shared<Texture>();
  stripes->width = kStripes * kTexels;
  stripes->height = 1;
  stripes->channels = 1;
  for (int x = 0; x < stripes->width; ++x) {
    stripes->floats.push_back(x / kTexels % 2 == 0 ? 0.0f : 1.0f);
  }
  Material striped = matte(1.0f);
  striped.base_color_texture.texture = stripes;
  striped.base_color_texture.wrap_u = striped.base_color_texture.wrap_v = Wrap::Clamp;
  TestWorld world;
  world.add("floor", make_plane(kSide, kSide), striped);
  for (int k = 0; k < kStripes; k += 2) {
    world.add("slat", make_box(Vec3(kWidth, 3 * kSide, 0.01)), matte(0.0f), at(middle(k), 0, 1.5));
  }
  constexpr double kIlluminance = 7.0;
  Light sun;
  sun.kind = LightKind::Distant;
  sun.color = Vec3f::Constant(float(kIlluminance));
  sun.angle_rad = 1e-3;
  world.add(sun);
  const Vec3 place(0.2, 1.1, 0.4);
  Affine upright = at(place.x(), place.y(), place.z());
  upright.linear() = Mat3(Eigen::AngleAxisd(0.5 * kPi, Vec3::UnitX()));
  world.add("wall", make_plane(0.1, 0.1), matte(0.8f), upright);

  constexpr int kSteps = 200;
  double factor = 0.0;
  for (int k = 1; k < kStripes; k += 2) {
    for (int i = 0; i < kSteps; ++i) {
      for (int j = 0; j < kSteps; ++j) {
        const Vec3 from(middle(k) + ((i + 0.5) / kSteps - 0.5) * kWidth,
                        ((j + 0.5) / kSteps - 0.5) * kSide, 0.0);
        const Vec3 to = place - from;
        factor += to.z() * to.y() / (kPi * to.squaredNorm() * to.squaredNorm());
      }
    }
  }
  factor *= kWidth * kSide / (kSteps * kSteps);
  const NodeId camera = world.add_camera(8, 6, 2000.0, place + Vec3(0.3, -1.0, 0.2), place);
  EmbreeRenderer::Params params = reference(2048, 1);
  params.path_reuse = GENERATE(false, true);
  CHECK(statistics(render(world, camera, params)).mean ==
        Approx(0.8 * factor * kIlluminance / kPi).epsilon(0.02));
}

TEST_CASE("light between two parallel bounces follows the geometric series", "[renderer]") {
  // Inside a closed sphere of albedo a with its own glow 1, radiance is 1 / (1 - a) everywhere.
  TestWorld world;
  Material wall = matte(0.5f);
  wall.emission.setOnes();
  world.add("shell", make_sphere(2.0, 96), wall);
  const NodeId camera = world.add_camera(16, 12, 10.0, Vec3(0.3, 0.2, 0.1), Vec3(1, 1, 0));
  CHECK(statistics(render(world, camera, reference(64, 40))).mean == Approx(2.0).epsilon(0.01));
}

TEST_CASE("light samples, BSDF samples and both together agree", "[renderer][mis][long]") {
  TestWorld world = busy_room();
  const NodeId camera = world.add_camera(40, 30, 22.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  RenderHost host(2);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const View view(world.scene, camera);
  const auto measure = [&](bool lights, bool bsdf, int samples, float indirect_share = 1.0f) {
    TraceSettings settings;
    settings.max_bounces = 3;
    settings.has_caustics = true;
    settings.samples_lights = lights;
    settings.samples_bsdf = bsdf;
    settings.indirect_share = indirect_share;
    const PathTracer tracer(scene, view, settings, Isa::Sse2);
    // Independent repetitions give the error of the mean.
    constexpr int kRuns = 12;
    std::vector<double> runs(kRuns, 0.0);
    host.parallel_for(kRuns, [&](std::size_t run) {
      std::vector<PixelSum> sums(1200);
      tracer.trace({0, 0, 40, 30, 0, std::uint32_t(samples),
                    SampleOrder(1000 + run, std::uint32_t(samples))},
                   sums.data(), 40);
      for (const PixelSum& sum : sums) runs[run] += double(sum.mean().scattered.mean()) / 1200.0;
    });
    double mean = 0.0;
    for (double r : runs) mean += r / kRuns;
    double variance = 0.0;
    for (double r : runs) variance += (r - mean) * (r - mean) / (kRuns - 1);
    return Statistics{mean, std::sqrt(variance / kRuns)};
  };
  const Statistics both = measure(true, true, 6);
  const Statistics lights = measure(true, false, 12);
  const Statistics bsdf = measure(false, true, 48);
  const Statistics fewer_bounces = measure(true, true, 12, 0.5f);
  CAPTURE(both.mean, both.error, lights.mean, lights.error, bsdf.mean, bsdf.error);
  REQUIRE(both.error < 0.01 * both.mean);
  REQUIRE(lights.error < 0.02 * lights.mean);
  REQUIRE(bsdf.error < 0.03 * bsdf.mean);
  CHECK(std::abs(both.mean - lights.mean) < 4.0 * std::hypot(both.error, lights.error));
  CHECK(std::abs(both.mean - bsdf.mean) < 4.0 * std::hypot(both.error, bsdf.error));
  CHECK(std::abs(both.mean - fewer_bounces.mean) <
        4.0 * std::hypot(both.error, fewer_bounces.error));
}

TEST_CASE("fireflies are rarer than one in a million samples", "[renderer][long]") {
  TestWorld world = busy_room();
  const NodeId camera = world.add_camera(40, 30, 22.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  RenderHost host(2);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const View view(world.scene, camera);
  const PathTracer tracer(scene, view, TraceSettings{}, Isa::Sse2);
  constexpr std::uint32_t kSamples = 1024;
  const SampleOrder order(5, kSamples);
  std::vector<PixelSum> sums(1200);
  tracer.trace({0, 0, 40, 30, 0, kSamples, order}, sums.data(), 40);
  const auto local_mean = [&](int x, int y) {
    double sum = 0.0;
    int count = 0;
    for (int v = std::max(0, y - 2); v <= std::min(29, y + 2); ++v) {
      for (int u = std::max(0, x - 2); u <= std::min(39, x + 2); ++u, ++count) {
        sum += double(luminance(sums[std::size_t(v * 40 + u)].mean().scattered));
      }
    }
    return sum / count;
  };
  std::vector<double> means;
  for (int i = 0; i < 1200; ++i) means.push_back(local_mean(i % 40, i / 40));
  int fireflies = 0;
  for (std::uint32_t s = 0; s < kSamples; ++s) {
    std::vector<PixelSum> one(1200);
    tracer.trace({0, 0, 40, 30, s, s + 1, order}, one.data(), 40);
    for (std::size_t i = 0; i < 1200; ++i) {
      fireflies += double(luminance(one[i].mean().scattered)) > 100.0 * means[i];
    }
  }
  CHECK(fireflies <= 1);
}

TEST_CASE("an error target gives the same bytes for every number of threads",
          "[renderer][determinism][long]") {
  TestWorld world = busy_room();
  const NodeId camera = world.add_camera(50, 35, 30.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  EmbreeRenderer::Params params = reference(256, 3);
  params.error_target = 0.1;
  const auto picture = [&](int threads, std::uint64_t& paths) {
    RenderHost host(threads);
    EmbreeRenderer renderer(params, host);
    renderer.prepare(world.scene);
    Frame frame = renderer.render({camera, {std::string(kColorHdr.name)}, 3});
    paths = renderer.last_counts().paths;
    return Image<Vec3f>(frame.get(kColorHdr));
  };
  std::uint64_t paths = 0;
  const Image<Vec3f> one = picture(1, paths);
  for (const int threads : {2, 7}) {
    std::uint64_t again = 0;
    CHECK(picture(threads, again) == one);
    CHECK(again == paths);
  }
  // Some blocks needed more than the first round, and some less than all samples.
  CHECK(paths > 50u * 35u * 17u);
  CHECK(paths < 50u * 35u * 200u);
  // The mean is that of a picture with even samples: four standard errors of a tenth per pixel.
  const double even = statistics(render(world, camera, reference(400, 3), 2, 8)).mean;
  CHECK(statistics(one).mean == Approx(even).epsilon(4.0 * 0.1 / std::sqrt(50.0 * 35.0)));
}

TEST_CASE("the instruction set is named, so that a dataset records it", "[renderer]") {
  const std::string name = EmbreeRenderer::Params().isa;
  CHECK(std::find(kIsaNames.begin(), kIsaNames.end(), name) != kIsaNames.end());
  CHECK_NOTHROW(isa_by_name(name));
  CHECK_THROWS_WITH(isa_by_name("mmx"), "isa: unknown instruction set mmx");
}

TEST_CASE("the same bytes come out for every number of threads", "[renderer][determinism]") {
  TestWorld world = busy_room();
  const NodeId camera = world.add_camera(50, 35, 30.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  EmbreeRenderer::Params params;
  params.samples = 5;
  const Image<Vec3f> one = render(world, camera, params, 1);
  for (const int threads : {2, 7}) CHECK(render(world, camera, params, threads) == one);
  CHECK(render(world, camera, params, 2, 4) != one);  // another seed, other noise
}

TEST_CASE("radiance is finite and never negative", "[renderer]") {
  TestWorld world = busy_room();
  Material glass;
  glass.base_color.setOnes();
  glass.transmission = 1.0f;
  glass.roughness = 0.15f;
  world.add("glass", make_sphere(0.4), glass, at(-0.2, -0.4, -0.6));
  Mesh broken = make_box(Vec3(0.3, 0.3, 0.3));
  broken.triangles.push_back({0, 0, 1});
  broken.normals.assign(broken.normals.size(), Vec3f::Zero());
  world.add("broken", broken, Material(), at(0.4, -0.8, -1.2));
  Light inside;
  inside.radius_m = 0.2;
  inside.color = Vec3f::Constant(50.0f);
  world.add(inside, at(0.8, 0.5, -0.9));  // within the metal ball
  const NodeId camera = world.add_camera(48, 36, 30.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  for (const bool denoise : {false, true}) {
    EmbreeRenderer::Params params = reference(24);
    params.denoise = denoise;
    params.caustics = !denoise;
    const Image<Vec3f> picture = render(world, camera, params);
    for (const Vec3f& p : picture.pixels()) {
      REQUIRE(p.allFinite());
      REQUIRE(p.minCoeff() >= 0.0f);
    }
  }
}

namespace {

/// A closed room of which a small lamp behind a screen lights one corner: all else is lit by walls.
TestWorld dim_room() {
  TestWorld world;
  const Mesh room = inside_out(make_box(Vec3(5, 4, 3)));
  world.add("room", room, matte(0.7f));
  Material red = matte(0.7f);
  red.base_color = Vec3f(0.75f, 0.25f, 0.2f);
  world.add("left", make_box(Vec3(0.1, 4, 3)), red, at(-2.5, 0, 0));
  Material blue = matte(0.7f);
  blue.base_color = Vec3f(0.3f, 0.5f, 0.75f);
  world.add("back", make_box(Vec3(5, 0.1, 3)), blue, at(0, 2, 0));
  world.add("screen", make_box(Vec3(0.2, 1.6, 2.2)), matte(0.7f), at(1.2, 1.2, -0.4));
  Light lamp;
  lamp.radius_m = 0.08;
  lamp.color = Vec3f(300.0f, 280.0f, 240.0f);
  world.add(lamp, at(2.0, 1.3, -0.8));
  return world;
}

constexpr int kDimWidth = 120;
constexpr int kDimHeight = 90;

NodeId camera_into_dim(TestWorld& world) {
  return world.add_camera(kDimWidth, kDimHeight, 60.0, Vec3(-0.4, -1.8, 0.5), Vec3(0.0, 1.0, -0.4));
}

struct DimPicture {
  std::vector<Vec3> scattered;
  double rays = 0.0;

  Vec3 mean() const {
    Vec3 sum = Vec3::Zero();
    for (const Vec3& p : scattered) sum += p / double(scattered.size());
    return sum;
  }
  /// Mean square of the pixels' errors, each relative to its brightness and a little more.
  double error(const DimPicture& truth) const {
    const double little = 0.05 * truth.mean().mean();
    double sum = 0.0;
    for (std::size_t i = 0; i < scattered.size(); ++i) {
      const double scale = truth.scattered[i].mean() + little;
      sum += (scattered[i] - truth.scattered[i]).squaredNorm() / (3.0 * scale * scale);
    }
    return sum / double(scattered.size());
  }
};

DimPicture traced(const PathTracer& tracer, SamplePlan plan, RenderHost& host) {
  RayCounts rays;
  const Film film = tracer.film(plan.next_round({}, 0.0), host, rays);
  DimPicture picture;
  for (const FilmPixel& pixel : film.pixels()) {
    picture.scattered.push_back(pixel.scattered.cast<double>());
  }
  picture.rays = double(rays.rays + rays.shadow_rays);
  return picture;
}

}  // namespace

TEST_CASE("paths that end in a cache find the light of whole paths with less noise",
          "[renderer][radiance_cache][long]") {
  TestWorld world = dim_room();
  const NodeId camera = camera_into_dim(world);
  RenderHost host(2);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const View view(world.scene, camera);
  const Isa isa = isa_by_name(EmbreeRenderer::Params().isa);
  TraceSettings settings;
  settings.max_bounces = 6;
  const PathTracer whole(scene, view, settings, isa);
  const auto plan_of = [](int samples, std::uint64_t seed) {
    return SamplePlan(kDimWidth, kDimHeight, {samples}, seed);
  };
  const DimPicture truth = traced(whole, plan_of(512, 77), host);
  // All pixels share the luck of a cache: one picture's mean is off by a hundredth by chance.
  constexpr int kRuns = 4;
  Vec3 mean = Vec3::Zero();
  Vec3 mean_of_learning = Vec3::Zero();
  double error_with = 0.0;
  double error_without = 0.0;
  double rays_with = 0.0;
  double rays_without = 0.0;
  double rays_to_learn = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const SamplePlan plan = plan_of(16, std::uint64_t(run));
    RayCounts learning;
    LearningPaths paths = whole.learn(plan.learning_jobs(), host, learning);
    const RadianceCache cache = paths.cache(view.position());
    paths.end_in(cache, host);
    double learning_paths = 0.0;
    Vec3 sum = Vec3::Zero();
    paths.for_each([&](const LearningPaths::Path& path) {
      sum += path.sample.scattered.cast<double>();
      ++learning_paths;
    });
    mean_of_learning += sum / learning_paths / kRuns;
    settings.cache = &cache;
    const DimPicture with = traced(PathTracer(scene, view, settings, isa), plan, host);
    const DimPicture without = traced(whole, plan, host);
    mean += with.mean() / kRuns;
    error_with += with.error(truth) / kRuns;
    error_without += without.error(truth) / kRuns;
    rays_with += with.rays;
    rays_without += without.rays;
    rays_to_learn += double(learning.rays + learning.shadow_rays);
  }
  const Vec3 expected = truth.mean();
  CAPTURE(error_with, error_without, mean, expected, rays_with, rays_without, rays_to_learn);
  CHECK(mean.mean() == Approx(expected.mean()).epsilon(0.02));
  for (int k = 0; k < 3; ++k) CHECK(mean[k] == Approx(expected[k]).epsilon(0.03));
  // Paths that learn are samples of their pixels, too; they are an eighth of as many.
  CHECK(mean_of_learning.mean() == Approx(expected.mean()).epsilon(0.03));
  CHECK(error_with < 0.35 * error_without);
  // Of as many paths.
  CHECK(rays_with < 0.75 * rays_without);
  CHECK(rays_with + rays_to_learn < 0.95 * rays_without);
}

TEST_CASE("denoised pictures come from a cache, the same for every number of threads",
          "[renderer][radiance_cache][determinism]") {
  TestWorld world = dim_room();
  const NodeId camera = camera_into_dim(world);
  EmbreeRenderer::Params params = reference(8);
  params.caustics = false;
  const auto picture = [&](bool denoise, bool radiance_cache, int threads) {
    params.denoise = denoise;
    params.radiance_cache = radiance_cache;
    return render(world, camera, params, threads);
  };
  const Image<Vec3f> one = picture(true, true, 1);
  CHECK(picture(true, true, 3) == one);
  CHECK(picture(true, false, 3) != one);
  // A picture that keeps its noise is not to be blurred either.
  CHECK(picture(false, true, 1) == picture(false, false, 3));
}

TEST_CASE("a moved object, a new material and a hidden one show in the next picture",
          "[renderer]") {
  TestWorld world;
  world.add(dome(1.0f));
  const NodeId ball = world.add("ball", make_sphere(0.3), matte(0.0f));
  const NodeId other = world.add("other", make_box(Vec3(0.1, 0.1, 0.1)), matte(0.3f), at(3, 3, 3));
  const NodeId camera = world.add_camera(32, 24, 30.0, Vec3(0, -3, 0), Vec3(0, 0, 0));
  RenderHost host(2);
  EmbreeRenderer renderer(reference(4), host);
  const auto leaf_at = [&](const Vec3& point) {
    renderer.prepare(world.scene);
    const Frame frame = renderer.render({camera, {std::string(kLeafId.name)}, 1});
    const Vec3 world_point = world.scene.world_from_node(world.base) * point;
    const Vec3 seen = world.scene.world_from_node(camera).inverse() * world_point;
    const Vec2 pixel = *project(*world.scene[camera].camera, seen);
    return frame.get(kLeafId).at(int(pixel.x()), int(pixel.y()));
  };
  CHECK(leaf_at(Vec3::Zero()) == ball.index);
  world.scene.set_pose(ball, at(0.7, 0.2, -0.3));
  CHECK(leaf_at(Vec3::Zero()) == 0);
  CHECK(leaf_at(Vec3(0.7, 0.2, -0.3)) == ball.index);
  world.scene.edit(ball).is_visible = false;
  CHECK(leaf_at(Vec3(0.7, 0.2, -0.3)) == 0);
  world.scene.edit(ball).is_visible = true;
  world.scene.erase(other);
  CHECK(leaf_at(Vec3(0.7, 0.2, -0.3)) == ball.index);

  const auto brightness = [&] {
    renderer.prepare(world.scene);
    const std::string hdr(kColorHdr.name);
    return statistics(renderer.render({camera, {hdr}, 1}).get(kColorHdr)).mean;
  };
  const double dark = brightness();
  world.scene.edit(ball).materials = {std::make_shared<const Material>(matte(1.0f))};
  CHECK(brightness() == Approx(1.0).margin(0.01));
  CHECK(dark < 0.99);
}

TEST_CASE("an updated scene renders the same bytes as a fresh renderer",
          "[renderer][determinism]") {
  TestWorld world = busy_room();
  const NodeId camera = world.add_camera(40, 30, 22.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  const NodeId ball = world.scene.find("/base/ball");
  RenderHost host(2);
  EmbreeRenderer renderer(reference(3), host);
  const std::string hdr(kColorHdr.name);
  renderer.prepare(world.scene);
  const Image<Vec3f> before = renderer.render({camera, {hdr}, 9}).get(kColorHdr);
  world.scene.set_pose(ball, at(0.2, 0.1, -0.4));
  renderer.prepare(world.scene);
  const Image<Vec3f> updated = renderer.render({camera, {hdr}, 9}).get(kColorHdr);
  CHECK(updated != before);
  CHECK(updated == render(world, camera, reference(3), 2, 9));
}

TEST_CASE("what moves as a rigid body renders the same bytes whatever came before",
          "[renderer][determinism]") {
  TestWorld world = busy_room();
  world.add(dome(0.3f));
  const NodeId camera = world.add_camera(40, 30, 22.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  const NodeId ball = world.scene.find("/base/ball");
  const NodeId box = world.scene.find("/base/box");
  world.scene.edit(ball).rigid_body = RigidBody();
  world.scene.edit(box).rigid_body = RigidBody();
  RenderHost host(2);
  EmbreeRenderer renderer(reference(3), host);
  const std::string hdr(kColorHdr.name);
  for (int i = 0; i < 3; ++i) {
    Affine pose = at(0.2, 0.1 * i, -0.4);
    pose.rotate(Eigen::AngleAxisd(0.7 * i, Vec3(0.6, 0.0, 0.8)));
    world.scene.set_pose(box, pose);
    world.scene.set_pose(ball, at(-0.3 * i, 0.1, -0.9));
    renderer.prepare(world.scene);
    CAPTURE(i);
    CHECK(renderer.render({camera, {hdr}, 9}).get(kColorHdr) ==
          render(world, camera, reference(3), 2, 9));
  }
}

TEST_CASE("every instruction set of this machine renders the same picture", "[renderer]") {
  TestWorld world = busy_room();
  const NodeId camera = world.add_camera(40, 30, 22.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  EmbreeRenderer::Params params = reference(16);
  params.isa = "sse2";
  const Statistics expected = statistics(render(world, camera, params));
  for (const char* isa : {"sse4.2", "avx2", "avx512"}) {
    params.isa = isa;
    CAPTURE(isa);
    try {
      const Statistics found = statistics(render(world, camera, params));
      CHECK(found.mean == Approx(expected.mean).epsilon(0.002));
    } catch (const Error& error) {
      CHECK(std::string(error.what()) == "isa: this processor does not have " + std::string(isa));
    }
  }
}

TEST_CASE("glass lets the light of a lamp into a closed room", "[renderer]") {
  // A lamp behind a pane, a solid slab or nothing, over a floor.
  const auto lit = [](const Material* screen, double thickness) {
    TestWorld world;
    world.add("floor", make_plane(6, 6), matte(0.8f));
    if (screen) world.add("screen", make_box(Vec3(6, 6, thickness)), *screen, at(0, 0, 0.8));
    Light lamp;
    lamp.radius_m = 0.2;
    lamp.color = Vec3f::Constant(20.0f);
    world.add(lamp, at(0.2, 0.1, 1.5));
    const NodeId camera = world.add_camera(12, 10, 40.0, Vec3(1, -1, 0.5), Vec3(0.1, 0.2, 0));
    EmbreeRenderer::Params params = reference(64, 4);
    params.caustics = false;
    return statistics(render(world, camera, params)).mean;
  };
  const double bare = lit(nullptr, 0.0);
  Material glass;
  glass.base_color.setOnes();
  glass.transmission = 1.0f;
  glass.roughness = 0.0f;
  const double slab = lit(&glass, 0.02);
  CHECK(slab > 0.85 * bare);
  CHECK(slab < 1.05 * bare);
  glass.base_color = Vec3f::Constant(0.5f);
  const double tinted = lit(&glass, 0.02);
  CHECK(tinted < 0.7 * bare);
  CHECK(tinted > 0.3 * bare);
  const Material wall = matte(0.5f);
  CHECK(lit(&wall, 0.02) < 1e-6);
}

TEST_CASE("what is seen through glass has no grain", "[renderer][denoiser]") {
  // One path of some ten goes to a bright wall instead of the dark floor: colours that are means
  // over such chances vary by a tenth from pixel to pixel.
  TestWorld world;
  world.add(dome(1.0f));
  world.add("floor", make_plane(8, 8), matte(0.15f));
  world.add("wall", make_box(Vec3(8, 0.1, 6)), matte(0.9f), at(0, 2.0, 3.0));
  Material glass;
  glass.base_color.setOnes();
  glass.transmission = 1.0f;
  glass.roughness = 0.0f;
  world.add("slab", make_box(Vec3(1.2, 3.0, 0.1)), glass, at(-0.6, 0, 0.4));
  const NodeId camera = world.add_camera(64, 48, 40.0, Vec3(0, -1.6, 1.6), Vec3(0, 0.1, 0.2));
  const auto grain = [](const Image<Vec3f>& picture, int begin, int end) {
    double sum = 0.0;
    double squares = 0.0;
    int count = 0;
    for (int y = 16; y < 40; ++y) {
      for (int x = begin; x < end; ++x) {
        double around = 0.0;
        for (int k = 0; k < 9; ++k) around += double(picture.at(x + k % 3 - 1, y + k / 3 - 1).x());
        const double own = double(picture.at(x, y).x());
        sum += own;
        squares += std::pow(own - around / 9.0, 2);
        ++count;
      }
    }
    return std::sqrt(squares / count) / (sum / count);
  };
  for (const int samples : {4, 16}) {
    EmbreeRenderer::Params params = reference(samples, 4);
    params.caustics = false;
    const double noisy = grain(render(world, camera, params), 8, 26);
    params.denoise = true;
    const Image<Vec3f> clean = render(world, camera, params);
    const double through = grain(clean, 8, 26);
    CAPTURE(samples, noisy, through);
    CHECK(noisy > 0.05);
    CHECK(through < 0.05);  // a fifth and an eighth without averaging them
  }
}

namespace {

/// A room with an opening to the sky and lamps of two kinds, and with screens, if any, before the
/// opening and around the lamps.
TestWorld screened_room(const Material* screen) {
  TestWorld world;
  Material wall = matte(0.6f);
  const auto slab = [&](const char* name, const Vec3& size, const Vec3& centre) {
    world.add(name, make_box(size), wall, at(centre.x(), centre.y(), centre.z()));
  };
  slab("floor", Vec3(4, 4, 0.1), Vec3(0, 0, -0.05));
  slab("ceiling", Vec3(4, 4, 0.1), Vec3(0, 0, 2.55));
  slab("back", Vec3(4, 0.1, 2.7), Vec3(0, 2.05, 1.25));
  slab("left", Vec3(0.1, 4, 2.7), Vec3(-2.05, 0, 1.25));
  slab("front", Vec3(4, 0.1, 2.7), Vec3(0, -2.05, 1.25));
  slab("below the window", Vec3(0.1, 4, 0.9), Vec3(2.05, 0, 0.45));
  Light lamp;
  lamp.radius_m = 0.08;
  lamp.color = Vec3f::Constant(60.0f);
  world.add(lamp, at(-0.8, 0.6, 1.6));
  Light panel;
  panel.kind = LightKind::Rect;
  panel.width_m = 0.5;
  panel.height_m = 0.3;
  panel.color = Vec3f::Constant(6.0f);
  world.add(panel, at(0.5, -0.4, 2.2));
  world.add(dome(0.8f));
  if (!screen) return world;
  world.add("bulb", make_sphere(0.1, 48), *screen, at(-0.8, 0.6, 1.6));
  world.add("cover", make_plane(1.0, 0.8), *screen, at(0.5, -0.4, 2.15));
  world.add("window", make_box(Vec3(0.01, 4, 1.6)), *screen, at(2.05, 0, 1.7));
  return world;
}

/// Means over blocks of 4 x 4 pixels.
std::vector<double> block_means(const Image<Vec3f>& image) {
  std::vector<double> means;
  for (int top = 0; top < image.height(); top += 4) {
    for (int left = 0; left < image.width(); left += 4) {
      double sum = 0.0;
      for (int i = 0; i < 16; ++i) sum += double(image.at(left + i % 4, top + i / 4).sum());
      means.push_back(sum);
    }
  }
  return means;
}

}  // namespace

TEST_CASE("screens that cannot be seen leave the light of a room as it is", "[renderer][long]") {
  Material pane;
  pane.base_color.setOnes();
  pane.transmission = 1.0f;
  pane.is_thin_walled = true;
  pane.roughness = 0.0f;
  pane.ior = 1.00001f;
  Material veil = matte(0.5f);
  veil.opacity = 0.0002f;
  const auto means = [](const Material* screen) {
    TestWorld world = screened_room(screen);
    const NodeId camera = world.add_camera(12, 8, 6.5, Vec3(-1.0, -1.9, 1.5), Vec3(0.0, 1.0, 0.9));
    return block_means(render(world, camera, reference(65536, 1)));
  };
  const std::vector<double> bare = means(nullptr);
  for (const Material* screen : {&pane, &veil}) {
    const std::vector<double> screened = means(screen);
    CAPTURE(screen == &pane ? "panes" : "veils");
    double sum = 0.0;
    for (std::size_t i = 0; i < bare.size(); ++i) {
      CAPTURE(i, screened[i] / bare[i]);
      CHECK(screened[i] == Approx(bare[i]).epsilon(0.01));
      sum += screened[i] / bare[i] / double(bare.size());
    }
    CHECK(sum == Approx(1.0).epsilon(0.002));
  }
}

TEST_CASE("modes and exposure do what they say", "[renderer]") {
  TestWorld world = busy_room();
  const NodeId camera = world.add_camera(48, 32, 26.0, Vec3(-1.8, -1.5, 0.6), Vec3(0.3, 0.6, -0.9));
  RenderHost host(2);
  const auto frame_of = [&](const char* mode, double ev) {
    EmbreeRenderer::Params params;
    params.mode = mode;
    params.samples = 4;
    params.exposure_ev = ev;
    EmbreeRenderer renderer(params, host);
    renderer.prepare(world.scene);
    return renderer.render({camera, {std::string(kColor.name), std::string(kColorHdr.name)}, 2});
  };
  const auto level = [](const Frame& frame) {
    double sum = 0.0;
    for (const Rgba8& p : frame.get(kColor).pixels()) sum += p[0] + p[1] + p[2];
    return sum / double(frame.get(kColor).pixels().size()) / 3.0;
  };
  for (const char* mode : {"path_traced", "real_time", "preview"}) {
    CAPTURE(mode);
    const Frame frame = frame_of(mode, 0.0);
    CHECK(level(frame) > 60.0);
    CHECK(level(frame) < 200.0);
    CHECK(frame.exposure > 0.0);
  }
  CHECK(level(frame_of("path_traced", 1.0)) > level(frame_of("path_traced", 0.0)) + 10.0);
  CHECK(statistics(frame_of("preview", 0).get(kColorHdr)).mean <
        statistics(frame_of("path_traced", 0).get(kColorHdr)).mean);
}

TEST_CASE("a scene without light says so, and a scene without anything renders", "[renderer]") {
  TestWorld world;
  const NodeId camera = world.add_camera(8, 6, 6.0, Vec3(0, -3, 0), Vec3(0, 0, 0));
  RenderHost host(1);
  EmbreeRenderer renderer({}, host);
  renderer.prepare(world.scene);
  REQUIRE(host.messages.size() == 1);
  CHECK(host.messages[0] == "the scene has no light: pictures will be black");
  const Frame frame =
      renderer.render({camera, {std::string(kColor.name), std::string(kLeafId.name)}, 1});
  CHECK(int(frame.get(kColor).at(3, 3)[0]) == 0);
  CHECK(frame.get(kLeafId).at(3, 3) == 0);
}

}  // namespace diorama
