// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <vector>

#include "diorama/rng.h"
#include "embree_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"

namespace diorama {
namespace {

using test::at;
using test::matte;
using test::RenderHost;
using test::TestWorld;

constexpr int kSize = 128;

Image<Vec3f> picture(const TestWorld& world, NodeId camera, int samples, std::uint64_t seed) {
  EmbreeRenderer::Params params;
  params.samples = samples;
  params.max_bounces = 1;
  params.denoise = false;
  RenderHost host(2);
  EmbreeRenderer renderer(params, host);
  renderer.prepare(world.scene);
  return renderer.render({camera, {std::string(kColorHdr.name)}, seed}).get(kColorHdr);
}

/// The variance of the means of blocks of 8 x 8 pixels, relative to what it would be if the errors
/// of neighbours had nothing to do with each other: 1 for white noise.
double low_frequencies(const std::vector<double>& errors) {
  constexpr int kBlock = 8;
  double blocks = 0.0;
  double pixels = 0.0;
  for (int y = 0; y < kSize; y += kBlock) {
    for (int x = 0; x < kSize; x += kBlock) {
      double sum = 0.0;
      for (int v = y; v < y + kBlock; ++v) {
        for (int u = x; u < x + kBlock; ++u) {
          const double error = errors[std::size_t(v * kSize + u)];
          sum += error;
          pixels += error * error;
        }
      }
      blocks += sum * sum;
    }
  }
  return blocks / pixels;
}

}  // namespace

TEST_CASE("errors of few paths are of high frequency: neighbours cancel", "[sampling][long]") {
  TestWorld world;
  world.add("floor", make_plane(8, 8), matte(0.6f));
  world.add("pillar", make_box(Vec3(0.3, 0.3, 1.0)), matte(0.3f), at(0.5, 0.3, 0.5));
  Light lamp;
  lamp.kind = LightKind::Rect;
  lamp.width_m = 1.5;
  lamp.height_m = 1.0;
  lamp.color = Vec3f::Constant(10.0f);
  world.add(lamp, at(-0.6, 0.2, 1.6));
  const NodeId camera = world.add_camera(kSize, kSize, 120.0, Vec3(0, -0.01, 3.0), Vec3(0, 0, 0));
  const Image<Vec3f> truth = picture(world, camera, 512, 99);
  for (const int samples : {1, 2, 4}) {
    const Image<Vec3f> noisy = picture(world, camera, samples, 1);
    std::vector<double> errors;
    for (std::size_t i = 0; i < truth.pixels().size(); ++i) {
      errors.push_back(double(noisy.pixels()[i].y()) - double(truth.pixels()[i].y()));
    }
    CAPTURE(samples);
    CHECK(low_frequencies(errors) < 0.3);
    // The same errors in any other order are white.
    Rng rng(4);
    for (std::size_t i = errors.size() - 1; i > 0; --i) {
      std::swap(errors[i], errors[std::size_t(rng.uniform(0.0, double(i) + 1.0))]);
    }
    CHECK(low_frequencies(errors) > 0.75);
  }
}

}  // namespace diorama
