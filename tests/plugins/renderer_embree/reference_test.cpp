// SPDX-License-Identifier: Apache-2.0
// Against pictures of the same scene that Blender's Cycles rendered with 4096 samples per pixel.
// The scene and the pictures lie beside the repository; without them the tests say so and pass.
#include <cmath>
#include <filesystem>
#include <string>

#include "benchmarks/bench_scene.h"
#include "embree_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "support/shared_data.h"

namespace diorama {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr int kBlockWidth = 32;
constexpr int kBlockHeight = 24;

struct Means {
  double ours = 0.0;
  double reference = 0.0;
  double spread = 0.0;  ///< Standard deviation of the reference's luminance over its mean.
};

Means block_means(const Image<Vec3f>& picture, const Texture& reference, int left, int top) {
  Means means;
  double sum = 0.0;
  double squares = 0.0;
  for (int y = top; y < top + kBlockHeight; ++y) {
    for (int x = left; x < left + kBlockWidth; ++x) {
      const float* p =
          &reference.floats[std::size_t(y * kWidth + x) * std::size_t(reference.channels)];
      const double l = double(luminance(Vec3f(p[0], p[1], p[2])));
      sum += l;
      squares += l * l;
      means.reference += double(p[0] + p[1] + p[2]);
      means.ours += double(picture.at(x, y).sum());
    }
  }
  constexpr double kPixels = kBlockWidth * kBlockHeight;
  means.spread = std::sqrt(std::max(0.0, kPixels * squares / (sum * sum) - 1.0));
  return means;
}

/// Flat areas agree within `tolerance`, and so does the whole picture within a fifth of it.
void check_against_reference(const std::string& materials, double tolerance) {
  const auto shared = test::shared_folder();
  if (!shared || !std::filesystem::exists(*shared / "bench/scene.glb")) {
    WARN("the folder of reference pictures is absent: nothing is compared");
    return;
  }
  const std::filesystem::path folder = *shared / "bench";
  test::RenderHost host(2);
  Scene scene = bench::load_bench_scene(folder, host, materials == "diffuse");
  const NodeId camera = bench::add_bench_camera(folder, scene, kWidth, kHeight);
  EmbreeRenderer::Params params;
  params.samples = 96;
  params.max_bounces = 4;
  params.caustics = true;
  params.denoise = false;
  params.sphere_lights = "disk";
  params.principled = "blender";
  params.isa = "sse2";  // the same noise on every machine
  EmbreeRenderer renderer(params, host);
  renderer.prepare(scene);
  const Frame frame = renderer.render({camera, {std::string(kColorHdr.name)}, 11});
  const auto reference =
      host.read_texture(folder / ("refs/ref_" + materials + "_320x240_4096spp.exr"));
  Means all;
  int flat = 0;
  for (int y = 0; y < kHeight; y += kBlockHeight) {
    for (int x = 0; x < kWidth; x += kBlockWidth) {
      const Means means = block_means(frame.get(kColorHdr), *reference, x, y);
      all.ours += means.ours;
      all.reference += means.reference;
      if (means.spread > 0.1) continue;
      ++flat;
      CAPTURE(materials, x, y);
      CHECK(means.ours == Approx(means.reference).epsilon(tolerance));
    }
  }
  CHECK(flat > 20);
  CHECK(all.ours == Approx(all.reference).epsilon(0.2 * tolerance));
}

}  // namespace

TEST_CASE("a room of matte surfaces is lit as Cycles lights it", "[reference]") {
  check_against_reference("diffuse", 0.01);
}

TEST_CASE("a room of principled surfaces is lit as Cycles lights it", "[reference]") {
  check_against_reference("pbr", 0.015);
}

}  // namespace diorama
