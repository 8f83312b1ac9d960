// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/virtual_lights.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "diorama/rng.h"
#include "embree_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"
#include "virtual_light_tracer.h"

namespace diorama {
namespace {

using test::at;
using test::camera_into_shade;
using test::inside_out;
using test::kShadeHeight;
using test::kShadeWidth;
using test::matte;
using test::means_of_blocks;
using test::relative_error;
using test::RenderHost;
using test::room_with_shade;
using test::TestWorld;

}  // namespace

TEST_CASE("a point of a part is met as a point of that part", "[virtual_lights]") {
  TestWorld world = room_with_shade();
  Mesh odd = make_box(Vec3(0.5, 0.4, 0.3));
  odd.triangles.resize(odd.triangles.size() - 1);  // One has no partner.
  world.add("odd", odd, matte(0.5f), at(-1.3, -0.9, 0.9));
  RenderHost host(1);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const std::size_t wanted = GENERATE(10u, 3000u);
  const SurfaceParts parts(scene.instances(), wanted);
  CHECK(parts.count() >= wanted);
  double area = 0.0;
  for (std::size_t side = 0; side < parts.count(); ++side) area += 0.5 * parts.area(side);
  double expected = 0.0;
  for (const MeshInstance& instance : scene.instances()) {
    for (const auto& t : instance.source().triangles) {
      const Vec3f a = instance.vertex(t[0]);
      expected += 0.5 * double((instance.vertex(t[1]) - a).cross(instance.vertex(t[2]) - a).norm());
    }
  }
  CHECK(area == Approx(expected).epsilon(1e-4));
  Rng rng(11);
  int tried = 0;
  int differing = 0;
  for (int i = 0; i < 6000; ++i) {
    const auto side = std::size_t(rng.uniform(0.0, double(parts.count()) - 0.001));
    const Vec2f u(float(rng.uniform()), float(rng.uniform()));
    const SurfaceParts::Point point = parts.point(side, float(rng.uniform()), u);
    constexpr float kAbove = 1e-3f;
    const RayHit hit =
        scene.intersect(point.position + kAbove * point.normal, -point.normal, 0.0f, 2 * kAbove);
    if (!hit) continue;
    const bool is_back = hit.normal.dot(point.normal) < 0.0f;
    ++tried;
    differing += parts.part_of(hit.number, hit.triangle, hit.u, hit.v, is_back) != side;
  }
  CHECK(tried > 5900);
  CHECK(differing < 12);  // by rounding, on rims
}

TEST_CASE("points of a part are spread over all of it", "[virtual_lights]") {
  TestWorld world;
  world.add("triangles", make_box(Vec3(3, 2, 1)), matte(0.5f));
  RenderHost host(1);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const SurfaceParts parts(scene.instances(), 40);
  Rng rng(5);
  // Sides by their areas, which are then spread over the box.
  std::vector<double> ends;
  double end = 0.0;
  for (std::size_t side = 0; side < parts.count(); ++side) ends.push_back(end += parts.area(side));
  const Affine box_from_world = world.scene.world_from_node(world.base).inverse();
  constexpr int kPoints = 40000;
  int high = 0;
  int at_end = 0;
  int corner = 0;
  for (int i = 0; i < kPoints; ++i) {
    const auto side = std::size_t(
        std::lower_bound(ends.begin(), ends.end(), rng.uniform(0.0, end)) - ends.begin());
    const Vec2f u(float(rng.uniform()), float(rng.uniform()));
    const Vec3 p =
        box_from_world * parts.point(side, float(rng.uniform()), u).position.cast<double>();
    high += p.z() > 0.4999;
    at_end += p.x() > 1.4999;
    corner += p.z() > 0.4999 && p.x() > 0.75 && p.y() > 0.5;
  }
  // Of 22 square metres.
  CHECK(high / double(kPoints) == Approx(6.0 / 22.0).margin(0.01));
  CHECK(at_end / double(kPoints) == Approx(2.0 / 22.0).margin(0.006));
  CHECK(corner / double(kPoints) == Approx(0.75 * 0.5 / 22.0).margin(0.003));
}

TEST_CASE("virtual lights leave the light of a room as it is, with less noise",
          "[virtual_lights][long]") {
  TestWorld world = room_with_shade();
  const NodeId camera = camera_into_shade(world);
  RenderHost host(2);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const View view(world.scene, camera);
  const Isa isa = isa_by_name(EmbreeRenderer::Params().isa);
  TraceSettings settings;
  settings.max_bounces = 4;
  const PathTracer alone(scene, view, settings, isa);
  const SurfaceParts parts(scene.instances(), 2000);
  const auto film = [&](const PathTracer& tracer, int samples, std::uint64_t seed) {
    SamplePlan plan(kShadeWidth, kShadeHeight, {samples}, seed);
    RayCounts rays;
    return tracer.film(plan.next_round({}, 0.0), host, rays);
  };
  const Film truth = film(alone, 16384, 77);
  std::vector<double> means(means_of_blocks(truth).size(), 0.0);
  double with = 0.0;
  double without = 0.0;
  constexpr int kRuns = 8;
  for (int run = 0; run < kRuns; ++run) {
    RayCounts rays;
    const VirtualLightTracer finder(scene, view, alone, parts, std::uint64_t(run), host, rays);
    const VirtualLights lights = finder.lights(1500, 0, rays);
    CHECK(lights.size() > 300);
    CHECK(lights.size() < 1500);
    settings.virtual_lights = &lights;
    const Film own = film(PathTracer(scene, view, settings, isa), 256, std::uint64_t(run));
    const std::vector<double> blocks = means_of_blocks(own);
    for (std::size_t k = 0; k < means.size(); ++k) means[k] += blocks[k] / kRuns;
    with += relative_error(own, truth) / kRuns;
    without += relative_error(film(alone, 256, std::uint64_t(run)), truth) / kRuns;
  }
  const std::vector<double> expected = means_of_blocks(truth);
  CAPTURE(with, without);
  double ratios = 0.0;
  for (std::size_t k = 0; k < means.size(); ++k) {
    CAPTURE(k, means[k], expected[k]);
    CHECK(means[k] == Approx(expected[k]).epsilon(0.04));
    ratios += means[k] / expected[k] / double(means.size());
  }
  CHECK(ratios == Approx(1.0).epsilon(0.01));
  CHECK(with < 0.3 * without);
}

TEST_CASE("pictures with virtual lights are the same for every number of threads",
          "[virtual_lights][determinism]") {
  TestWorld world = room_with_shade();
  const NodeId camera = world.add_camera(160, 120, 80.0, Vec3(-0.9, -1.8, 0.7), Vec3(0.1, 0.6, 0));
  EmbreeRenderer::Params params;
  params.samples = 4;
  params.denoise = false;
  params.exposure = "fixed";
  const auto picture = [&](bool virtual_lights, int threads, std::uint64_t seed = 3) {
    params.virtual_lights = virtual_lights;
    RenderHost host(threads);
    EmbreeRenderer renderer(params, host);
    renderer.prepare(world.scene);
    return renderer.render({camera, {std::string(kColorHdr.name)}, seed}).get(kColorHdr);
  };
  const Image<Vec3f> one = picture(true, 1);
  CHECK(picture(true, 3) == one);
  CHECK(picture(false, 3) != one);
  CHECK(picture(true, 3, 4) != one);
}

TEST_CASE("virtual lights serve rooms that the sun shines into, as a light or in a sky's picture",
          "[virtual_lights]") {
  Light sun;
  sun.kind = LightKind::Distant;
  sun.angle_rad = 0.01;
  sun.color = Vec3f::Constant(5000.0f);
  Texture cloudless;
  cloudless.width = 512;
  cloudless.height = 256;
  cloudless.channels = 3;
  cloudless.floats.assign(512 * 256 * 3, 1.0f);
  // A disk of four pixels is nearly overhead.
  const Vec2f place(0.3f, 0.03f);
  for (int k = 0; k < 12; ++k) {
    const int x = int(place.x() * 512.0f) + k / 3 % 2;
    const int y = int(place.y() * 256.0f) + k / 6;
    cloudless.floats[std::size_t((y * 512 + x) * 3 + k % 3)] = 1e6f;
  }
  const DomeTexture with_sun(cloudless);
  CHECK(with_sun.has_sun());
  CHECK(with_sun.is_sun(place + Vec2f::Constant(1e-3f)));
  CHECK_FALSE(with_sun.is_sun({0.8f, 0.03f}));
  CHECK_FALSE(with_sun.is_sun({0.3f, 0.5f}));
  Light sky = test::dome(1.0f);
  Light sunny = sky;
  sunny.texture = std::make_shared<const Texture>(std::move(cloudless));
  const std::vector<std::pair<std::vector<Light>, bool>> skies{
      {{sky, sun}, true}, {{sunny}, true}, {{sky}, false}};
  for (const auto& [lights, are_wanted] : skies) {
    TestWorld world;
    world.add("floor", make_box(Vec3(4, 4, 0.1)), matte(0.6f), at(0, 0, -1.5));
    for (int side = 0; side < 4; ++side) {
      Affine turned(Eigen::AngleAxisd(0.5 * kPi * side, Vec3::UnitZ()));
      world.add("wall_" + std::to_string(side), make_box(Vec3(4, 0.1, 3)), matte(0.6f),
                turned * at(0, 2, 0));
      // What they leave open is 0.5 m wide.
      world.add("roof_" + std::to_string(side), make_box(Vec3(2.25, 1.75, 0.1)), matte(0.6f),
                turned * at(-0.875, 1.125, 1.5));
    }
    for (const Light& light : lights) world.add(light);
    const NodeId camera = camera_into_shade(world);
    RenderHost host(2);
    EmbreeScene scene(host, {});
    scene.take(world.scene);
    CHECK(scene.lights().has_small_lights() == are_wanted);
    const View view(world.scene, camera);
    const PathTracer tracer(scene, view, {}, isa_by_name(EmbreeRenderer::Params().isa));
    const SurfaceParts parts(scene.instances(), 3000);
    RayCounts rays;
    const VirtualLightTracer finder(scene, view, tracer, parts, 1, host, rays);
    CHECK(finder.are_worth_it() == are_wanted);
  }
}

TEST_CASE("a room without light has no virtual lights", "[virtual_lights]") {
  TestWorld world;
  world.add("room", inside_out(make_box(Vec3(4, 4, 3))), matte(0.6f));
  const NodeId camera = camera_into_shade(world);
  RenderHost host(2);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const View view(world.scene, camera);
  const PathTracer tracer(scene, view, {}, isa_by_name(EmbreeRenderer::Params().isa));
  const SurfaceParts parts(scene.instances(), 100);
  RayCounts rays;
  const VirtualLightTracer finder(scene, view, tracer, parts, 1, host, rays);
  const VirtualLights lights = finder.lights(50, 0, rays);
  CHECK(lights.size() == 0);
}

}  // namespace diorama
