// SPDX-License-Identifier: Apache-2.0
// A process of its own: what it held at most while a large picture was made is the measure.
#include <fstream>
#include <string>

#include "diorama/abi.h"
#include "embree_renderer.h"
#include "null_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"

namespace diorama {
namespace {

constexpr int kSize = 2048;
constexpr double kMiB = 1024.0 * 1024.0;

double status_mib(const std::string& key) {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    double kib = 0.0;
    if (word == key && status >> kib) return kib / 1024.0;
  }
  return 0.0;
}

/// From now on the peak is that of what comes.
void forget_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

/// What a picture with five channels takes at most, and what it should take, in MiB.
struct Memory {
  double taken = 0.0;
  double announced = 0.0;
  double channels = 0.0;
};
Memory memory_of_picture(Renderer& renderer) {
  test::TestWorld world;
  world.add("ball", make_sphere(1.0), test::matte(0.5f));
  world.add(test::dome(1.0f));
  const NodeId camera = world.add_camera(kSize, kSize, 1500.0, Vec3(3, -2, 1), Vec3(0, 0, 0));
  const NameSet names{std::string(kColor.name), std::string(kDistanceToCamera.name),
                      std::string(kNormals.name), std::string(kLeafId.name),
                      std::string(kPosition.name)};
  Memory memory;
  memory.channels = (4 + 4 + 12 + 4 + 12) * double(kSize) * double(kSize) / kMiB;
  memory.announced = double(renderer.working_bytes(*world.scene[camera].camera, names)) / kMiB;
  renderer.prepare(world.scene);
  const double before = status_mib("VmRSS:");
  forget_peak();
  const Frame frame = renderer.render({camera, names, 1});
  memory.taken = status_mib("VmHWM:") - before;
  CHECK(frame.get(kLeafId).at(kSize / 2, kSize / 2) != 0);
  return memory;
}

}  // namespace

TEST_CASE("a large picture takes what its renderer announces, and no more", "[memory]") {
#if DIORAMA_DETAIL_ADDRESS_SANITIZER || DIORAMA_DETAIL_THREAD_SANITIZER
  WARN("sanitizers need memory of their own: not measured");
#else
  test::RenderHost host(2);
  {
    NullRenderer renderer({}, host);
    const Memory memory = memory_of_picture(renderer);
    INFO("null: " << memory.taken << " MiB");
    CHECK(memory.taken > 0.9 * memory.channels);
    CHECK(memory.taken < memory.channels + memory.announced + 16.0);
  }
  EmbreeRenderer::Params params;
  params.samples = 2;
  params.max_bounces = 1;
  EmbreeRenderer renderer(params, host);
  const Memory memory = memory_of_picture(renderer);
  INFO("embree: " << memory.taken << " MiB, announced " << memory.announced);
  CHECK(memory.taken > memory.channels + 0.6 * memory.announced);
  CHECK(memory.taken < memory.channels + memory.announced + 32.0);
  CHECK(memory.channels + memory.announced < 800.0);
#endif
}

}  // namespace diorama
