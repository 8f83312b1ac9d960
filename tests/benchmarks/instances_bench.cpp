// SPDX-License-Identifier: Apache-2.0
// What copies of one mesh cost: memory, preparation, rays. Prints one JSON line per count, each
// measured in a process of its own.
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "diorama/geometry.h"
#include "diorama/rng.h"
#include "embree_scene.h"
#include "framework/host/machine_limits.h"
#include "renderer_support/isa.h"
#include "support/render_host/render_host.h"

namespace {

using namespace diorama;

double resident_mib() {
  std::size_t total = 0;
  std::size_t resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return double(resident) * double(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

struct Options {
  std::vector<int> counts{1, 2, 5, 100, 400};
  int segments = 125;
  int threads = 2;
  bool has_own_meshes = false;
};

/// In a room of 6 x 6 x 3 m, whatever their number.
Scene make_scene(const Options& options, int count) {
  Scene scene;
  Rng rng(1);
  const NodeId room = scene.create(scene.root(), "room");
  scene.edit(room).mesh = std::make_shared<const Mesh>(make_box(Vec3(6, 6, 3)));
  const Mesh ball = make_sphere(0.12, options.segments);
  const auto shared = std::make_shared<const Mesh>(ball);
  for (int i = 0; i < count; ++i) {
    const NodeId node = scene.create(scene.root(), "ball");
    scene.edit(node).mesh = options.has_own_meshes ? std::make_shared<const Mesh>(ball) : shared;
    scene.edit(node).rigid_body = RigidBody{};
    scene.set_pose(node, Affine(Eigen::Translation3d(rng.uniform(-2.8, 2.8), rng.uniform(-2.8, 2.8),
                                                     rng.uniform(-1.4, 1.4))));
  }
  return scene;
}

/// Million rays per CPU second, from random points in random directions; what they met goes along
/// so that the work is not left out.
std::pair<double, std::size_t> ray_rate(const EmbreeScene& scene) {
  constexpr int kBatches = 8000;
  Rng rng(2);
  std::vector<BatchRays> batches(64);
  for (BatchRays& rays : batches) {
    for (std::size_t i = 0; i < kBatch; ++i) {
      const Vec3 origin(rng.uniform(-2.8, 2.8), rng.uniform(-2.8, 2.8), rng.uniform(-1.4, 1.4));
      const Vec2f u(float(rng.uniform()), float(rng.uniform()));
      rays.add(origin.cast<float>(), uniform_sphere(u), 0.0f, kInfinite, kMoment);
    }
  }
  BatchHits hits;
  std::size_t met = 0;
  const double start = cpu_seconds();
  for (int i = 0; i < kBatches; ++i) {
    scene.intersect(batches[std::size_t(i) % batches.size()], hits);
    met += hits.number[0] > 0 ? 1 : 0;
  }
  return {1e-6 * kBatches * double(kBatch) / (cpu_seconds() - start), met};
}

void measure(const Options& options, int count) {
  test::RenderHost host(options.threads);
  Scene scene = make_scene(options, count);
  EmbreeScene rays(host, {best_isa_name(), {}});
  const double before = resident_mib();
  double start = cpu_seconds();
  rays.take(scene);
  const double prepare = cpu_seconds() - start;
  const double memory = resident_mib() - before;
  for (const NodeId node : scene.match("/ball*")) {
    Affine pose = scene[node].parent_from_node;
    pose.translation().x() += 0.01;
    scene.set_pose(node, pose);
  }
  start = cpu_seconds();
  rays.take(scene);
  const double update = cpu_seconds() - start;
  const auto [rate, met] = ray_rate(rays);
  nlohmann::ordered_json line;
  line["copies"] = count;
  line["triangles_each"] = scene[scene.find("/ball")].mesh->triangles.size();
  line["trees"] = rays.trees().in_world + rays.trees().shared;
  line["memory_mib"] = memory;
  line["prepare_cpu_s"] = prepare;
  line["update_cpu_s"] = update;
  line["mrays_per_cpu_s"] = rate;
  line["met"] = met;
  std::printf("%s\n", line.dump().c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Measures what copies of a mesh cost"};
  app.add_option("counts", options.counts, "Numbers of copies");
  app.add_option("--segments", options.segments,
                 "Of the ball, which has about this squared triangles");
  app.add_option("--threads", options.threads);
  app.add_flag("--own", options.has_own_meshes, "Each copy has a mesh of its own");
  CLI11_PARSE(app, argc, argv);
  for (const int count : options.counts) {
    const pid_t child = fork();
    if (child == 0) {
      measure(options, count);
      return 0;
    }
    int status = 0;
    waitpid(child, &status, 0);
    if (child < 0 || status != 0) return 1;
  }
}
