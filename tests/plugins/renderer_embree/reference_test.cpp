// SPDX-License-Identifier: Apache-2.0
// Against pictures of the same scene that Blender's Cycles rendered with 4096 samples per pixel.
// The scene and the pictures lie beside the repository; without them the tests say so and pass.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "benchmarks/bench_scene.h"
#include "embree_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "support/shared_data.h"

namespace diorama {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;

/// The bench scene, lit and shaded as Cycles does it.
class Bench {
 public:
  static bool is_there() {
    const auto shared = test::shared_folder();
    const bool is_there = shared && std::filesystem::exists(*shared / "bench/scene.glb");
    if (!is_there) WARN("the folder of reference pictures is absent: nothing is compared");
    return is_there;
  }

  Bench(const std::string& materials, int samples, bool has_caustics, bool reuses_paths = true)
      : host_(2),
        scene_(bench::load_bench_scene(folder(), host_, materials == "diffuse")),
        camera_(bench::add_bench_camera(folder(), scene_, kWidth, kHeight)),
        renderer_(params(samples, has_caustics, reuses_paths), host_),
        reference_(kWidth, kHeight, Vec3f::Zero()) {
    renderer_.prepare(scene_);
    const auto texture =
        host_.read_texture(folder() / ("refs/ref_" + materials + "_320x240_4096spp.exr"));
    for (std::size_t i = 0; i < reference_.pixels().size(); ++i) {
      const float* p = &texture->floats[i * std::size_t(texture->channels)];
      reference_.pixels()[i] = Vec3f(p[0], p[1], p[2]);
    }
  }

  Image<Vec3f> picture(std::uint64_t seed) {
    return renderer_.render({camera_, {std::string(kColorHdr.name)}, seed}).get(kColorHdr);
  }
  const Image<Vec3f>& reference() const { return reference_; }

 private:
  static std::filesystem::path folder() { return *test::shared_folder() / "bench"; }
  static EmbreeRenderer::Params params(int samples, bool has_caustics, bool reuses_paths) {
    EmbreeRenderer::Params params;
    params.samples = samples;
    params.max_bounces = 4;
    params.caustics = has_caustics;
    params.denoise = false;
    params.path_reuse = reuses_paths;
    params.sphere_lights = "disk";
    params.principled = "blender";
    params.isa = "sse2";  // the same noise on every machine
    return params;
  }

  test::RenderHost host_;
  Scene scene_;
  NodeId camera_;
  EmbreeRenderer renderer_;
  Image<Vec3f> reference_;
};

struct Block {
  int left = 0;
  int top = 0;
  int width = 0;
  int height = 0;
};

Vec3f mean_of(const Image<Vec3f>& picture, const Block& block) {
  Vec3f sum = Vec3f::Zero();
  for (int y = block.top; y < block.top + block.height; ++y) {
    for (int x = block.left; x < block.left + block.width; ++x) sum += picture.at(x, y);
  }
  return sum / float(block.width * block.height);
}

/// Standard deviation of the luminance over its mean.
double spread_of(const Image<Vec3f>& picture, const Block& block) {
  double sum = 0.0;
  double squares = 0.0;
  for (int y = block.top; y < block.top + block.height; ++y) {
    for (int x = block.left; x < block.left + block.width; ++x) {
      const double l = double(luminance(picture.at(x, y)));
      sum += l;
      squares += l * l;
    }
  }
  const double pixels = block.width * block.height;
  return std::sqrt(std::max(0.0, pixels * squares / (sum * sum) - 1.0));
}

/// Blocks of the picture without strong edges.
std::vector<Block> flat_blocks(const Image<Vec3f>& picture, int width, int height,
                               double most_spread) {
  std::vector<Block> blocks;
  for (int y = 0; y < kHeight; y += height) {
    for (int x = 0; x < kWidth; x += width) {
      const Block block{x, y, width, height};
      if (spread_of(picture, block) <= most_spread) blocks.push_back(block);
    }
  }
  return blocks;
}

/// Flat areas agree within `tolerance`, and the means of the whole pictures to 0.1 %. The error of
/// blocks of 4 x 4 pixels without edges stays below `most_error`: single pixels would need
/// a thousand paths to tell noise from bias.
void check_against_reference(const std::string& materials, double tolerance, double most_error) {
  if (!Bench::is_there()) return;
  // Neighbours share a part of their errors, so means of blocks have it, too: in one picture of as
  // many paths they are off by half a per cent by chance (ADR 0103).
  constexpr int kPictures = 4;
  Bench bench(materials, 96, true);
  Image<Vec3f> ours(kWidth, kHeight, Vec3f::Zero());
  for (std::uint64_t seed = 0; seed < kPictures; ++seed) {
    const Image<Vec3f> picture = bench.picture(11 + seed);
    for (std::size_t i = 0; i < ours.pixels().size(); ++i) {
      ours.pixels()[i] += picture.pixels()[i] / float(kPictures);
    }
  }
  const Image<Vec3f>& reference = bench.reference();
  CAPTURE(materials);

  const auto large = flat_blocks(reference, 32, 24, 0.1);
  CHECK(large.size() > 20);
  for (const Block& block : large) {
    CAPTURE(block.left, block.top);
    CHECK(double(mean_of(ours, block).sum()) ==
          Approx(double(mean_of(reference, block).sum())).epsilon(tolerance));
  }
  const Block all{0, 0, kWidth, kHeight};
  CHECK(double(mean_of(ours, all).sum()) ==
        Approx(double(mean_of(reference, all).sum())).epsilon(0.001));

  const auto small = flat_blocks(reference, 4, 4, 0.25);
  CHECK(small.size() > std::size_t(kWidth * kHeight / 16 * 3 / 4));
  double error = 0.0;
  for (const Block& block : small) {
    const Vec3f expected = mean_of(reference, block);
    const Vec3f off = mean_of(ours, block) - expected;
    for (int k = 0; k < 3; ++k) {
      error += double(off[k] * off[k]) / double(expected[k] * expected[k] + 0.01f);
    }
  }
  CHECK(error / (3.0 * double(small.size())) < most_error);
}

/// Pictures of one path per pixel, a million paths, with the settings that pictures have by
/// default: light that mirrors focus is not searched by chance. Fireflies are brighter than a
/// hundred times their surroundings.
void check_single_paths(const std::string& materials, bool reuses_paths, int most_fireflies) {
  if (!Bench::is_there()) return;
  Bench bench(materials, 1, false, reuses_paths);
  constexpr int kPictures = 14;
  constexpr int kReach = 2;  // pixels, of what counts as local
  int fireflies = 0;
  int wrong = 0;
  for (int i = 0; i < kPictures; ++i) {
    const Image<Vec3f> picture = bench.picture(std::uint64_t(i));
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Vec3f& path = picture.at(x, y);
        wrong += !path.allFinite() || path.minCoeff() < 0.0f;
        const int left = std::clamp(x - kReach, 0, kWidth - 2 * kReach - 1);
        const int top = std::clamp(y - kReach, 0, kHeight - 2 * kReach - 1);
        const Block around{left, top, 2 * kReach + 1, 2 * kReach + 1};
        const float local = luminance(mean_of(bench.reference(), around));
        fireflies += luminance(path) > 100.0f * local;
      }
    }
  }
  CAPTURE(materials, reuses_paths);
  CHECK(wrong == 0);
  CHECK(fireflies <= most_fireflies);
}

}  // namespace

TEST_CASE("a room of matte surfaces is lit as Cycles lights it", "[reference]") {
  check_against_reference("diffuse", 0.01, 0.001);
}

TEST_CASE("a room of principled surfaces is lit as Cycles lights it", "[reference]") {
  check_against_reference("pbr", 0.01, 0.001);
}

TEST_CASE("hardly a path is far brighter than its surroundings, none negative or not a number",
          "[reference]") {
  for (const char* materials : {"diffuse", "pbr"}) {
    check_single_paths(materials, false, 1);
    // Of these one of four brings all that is found beyond second surfaces, with as much weight.
    check_single_paths(materials, true, 3);
  }
}

}  // namespace diorama
