// SPDX-License-Identifier: Apache-2.0
#include "path_reuse.h"

#include <string>
#include <vector>

#include "embree_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"
#include "virtual_light_tracer.h"

namespace diorama {
namespace {

using test::at;
using test::camera_into_shade;
using test::kShadeHeight;
using test::kShadeWidth;
using test::means_of_blocks;
using test::relative_error;
using test::RenderHost;
using test::room_with_shade;
using test::TestWorld;

SamplePlan plan_of_tiles(int width, int height, int samples, std::uint64_t seed) {
  SamplePlan::Limits limits{samples};
  PixelTiles::of_picture(width, height).set_blocks(limits);
  return {width, height, limits, seed};
}

/// Lit by the sky over the middle.
TestWorld room_with_skylight() {
  TestWorld world;
  world.add("floor", make_box(Vec3(4, 4, 0.1)), matte(0.6f), at(0, 0, -1.5));
  for (int side = 0; side < 4; ++side) {
    Affine turned(Eigen::AngleAxisd(0.5 * kPi * side, Vec3::UnitZ()));
    world.add("wall_" + std::to_string(side), make_box(Vec3(4, 0.1, 3)), matte(0.6f),
              turned * at(0, 2, 0));
    // What they leave open is 2 m wide.
    world.add("roof_" + std::to_string(side), make_box(Vec3(3, 1, 0.1)), matte(0.6f),
              turned * at(-0.5, 1.5, 1.5));
  }
  Material lacquer;
  lacquer.base_color = Vec3f(0.2f, 0.4f, 0.7f);
  lacquer.roughness = 0.25f;
  world.add("table", make_box(Vec3(1.2, 0.9, 0.1)), lacquer, at(-0.4, 0.3, -0.9));
  Material metal = lacquer;
  metal.metallic = 1.0f;
  metal.roughness = 0.5f;
  Affine mirrored = at(0.6, -0.4, -1.1);
  mirrored.linear().col(0) *= -1.0;
  world.add("ball", make_sphere(0.3), metal, mirrored);
  Material pane;
  pane.base_color = Vec3f(0.9f, 1.0f, 0.9f);
  pane.transmission = 1.0f;
  pane.is_thin_walled = true;
  pane.roughness = 0.0f;
  world.add("pane", make_box(Vec3(0.9, 0.01, 0.9)), pane, at(1.0, 0.3, -0.4));
  Material veil = matte(0.5f);
  veil.opacity = 0.4f;
  world.add("veil", make_box(Vec3(0.01, 0.8, 0.8)), veil, at(-1.2, 0.9, 0.2));
  world.add(test::dome(1.0f));
  return world;
}

}  // namespace

TEST_CASE("paths that use those of others leave the light of a room as it is",
          "[path_reuse][long]") {
  const bool is_connected = GENERATE(false, true);
  const int samples = GENERATE(3, 48);  // one is no multiple of those that one goes on of
  CAPTURE(is_connected, samples);
  TestWorld world = is_connected ? room_with_shade() : room_with_skylight();
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
  RayCounts rays;
  const VirtualLightTracer finder(scene, view, alone, parts, 9, host, rays);
  VirtualLights lights = finder.lights(1500, 0, rays);
  const auto film = [&](const PathTracer& tracer, int count, std::uint64_t seed) {
    SamplePlan plan = plan_of_tiles(kShadeWidth, kShadeHeight, count, seed);
    return tracer.film(plan.next_round({}, 0.0), host, rays);
  };
  const auto settings_with = [&](bool reuses_paths) {
    TraceSettings own = settings;
    own.reuses_paths = reuses_paths;
    if (is_connected) own.virtual_lights = &lights;
    return own;
  };
  const Film truth = film(alone, is_connected ? 8192 : 4096, 77);
  const std::vector<double> expected = means_of_blocks(truth);
  std::vector<double> means(expected.size(), 0.0);
  const int runs = 1536 / samples;
  for (int run = 0; run < runs; ++run) {
    // One set of lights has errors of its own.
    if (is_connected && run % (runs / 16) == 0) {
      lights = finder.lights(1500, std::uint64_t(run), rays);
    }
    const auto seed = std::uint64_t(run);
    const Film own = film(PathTracer(scene, view, settings_with(true), isa), samples, seed);
    const std::vector<double> blocks = means_of_blocks(own);
    for (std::size_t k = 0; k < means.size(); ++k) means[k] += blocks[k] / runs;
  }
  // Neighbours share their luck: means vary more than with as many paths of their own.
  double ratios = 0.0;
  for (std::size_t k = 0; k < means.size(); ++k) {
    CAPTURE(k, means[k], expected[k]);
    CHECK(means[k] == Approx(expected[k]).epsilon(is_connected ? 0.1 : 0.05));
    ratios += means[k] / expected[k] / double(means.size());
  }
  CHECK(ratios == Approx(1.0).epsilon(is_connected ? 0.03 : 0.02));
}

TEST_CASE("paths that use those of others have less noise for their rays", "[path_reuse][long]") {
  TestWorld world = room_with_skylight();
  constexpr int kFineWidth = 160;
  constexpr int kFineHeight = 120;
  const NodeId camera =
      world.add_camera(kFineWidth, kFineHeight, 95.0, Vec3(-0.9, -1.8, 0.7), Vec3(0.1, 0.6, -0.2));
  RenderHost host(2);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const View view(world.scene, camera);
  TraceSettings settings;
  const auto rays_times_noise = [&](bool reuses_paths) {
    settings.reuses_paths = reuses_paths;
    const PathTracer tracer(scene, view, settings, isa_by_name(EmbreeRenderer::Params().isa));
    RayCounts rays;
    const auto film = [&](std::uint64_t seed) {
      SamplePlan plan = plan_of_tiles(kFineWidth, kFineHeight, 16, seed);
      return tracer.film(plan.next_round({}, 0.0), host, rays);
    };
    const Film first = film(5);
    const double noise = relative_error(first, film(6));
    CAPTURE(reuses_paths, noise, rays.rays, rays.shadow_rays);
    CHECK(noise > 0.0);
    return noise * double(rays.rays + rays.shadow_rays);
  };
  const double with = rays_times_noise(true);
  const double without = rays_times_noise(false);
  CAPTURE(with, without);
  CHECK(with < 0.5 * without);
}

TEST_CASE("pictures whose paths use those of others are the same for every number of threads",
          "[path_reuse][determinism]") {
  TestWorld world = room_with_shade();
  const NodeId camera = world.add_camera(64, 48, 32.0, Vec3(-0.9, -1.8, 0.7), Vec3(0.1, 0.6, 0));
  EmbreeRenderer::Params params;
  params.samples = 4;
  params.denoise = false;
  params.exposure = "fixed";
  const auto picture = [&](bool path_reuse, int threads, double error_target = 0.0) {
    params.path_reuse = path_reuse;
    params.error_target = error_target;
    RenderHost host(threads);
    EmbreeRenderer renderer(params, host);
    renderer.prepare(world.scene);
    return renderer.render({camera, {std::string(kColorHdr.name)}, 3}).get(kColorHdr);
  };
  const Image<Vec3f> one = picture(true, 1);
  CHECK(picture(true, 3) == one);
  CHECK(picture(false, 3) != one);
  params.samples = 32;
  CHECK(picture(true, 1, 0.3) == picture(true, 3, 0.3));
}

}  // namespace diorama
