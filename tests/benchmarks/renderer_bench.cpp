// SPDX-License-Identifier: Apache-2.0
// Renders the bench scene and prints speed and error; see run_renderer.sh beside this file.
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "bench_scene.h"
#include "embree_renderer.h"
#include "path_tracer.h"
#ifdef DIORAMA_HAS_VULKAN
#include "vulkan_renderer.h"
#endif
#include "framework/bench/picture_error.h"
#include "framework/host/machine_limits.h"
#include "framework/images/linear_picture.h"
#include "renderer_support/sample_plan.h"
#include "support/render_host/render_host.h"

namespace {

using namespace diorama;

double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

/// Traces the blocks in the picture's middle as for a picture, then the very same rays by Embree
/// alone, in turns on one thread; returns the share of the time that the rays need.
double share_of_raw_rays(const Scene& scene, NodeId camera, Host& host,
                         const EmbreeRenderer::Params& params) {
  const Isa isa = isa_by_name(params.isa);
  EmbreeScene meshes(host, {kIsaNames[std::size_t(isa)],
                            {params.sphere_lights == "disk", params.principled == "blender"}});
  meshes.take(scene);
  const View view(scene, camera);
  TraceSettings settings{params.max_bounces, float(params.clamp), params.caustics};
  const int width = view.camera().width;
  const int height = view.camera().height;
  const int samples = std::min(params.samples, 16);
  std::vector<TraceJob> jobs = SamplePlan(width, height, {samples}, 1).next_round({}, 0.0);
  std::erase_if(jobs, [&](const TraceJob& job) {
    return job.x_begin < width / 4 || job.x_end > 3 * width / 4 || job.y_begin < height / 4 ||
           job.y_end > 3 * height / 4;
  });
  const auto trace = [&](const PathTracer& tracer) {
    for (const TraceJob& job : jobs) {
      std::vector<PixelSum> sums(job.pixel_count());
      tracer.trace(job, sums.data(), std::size_t(job.x_end - job.x_begin));
    }
  };
  std::vector<LoggedRay> rays;
  settings.ray_log = &rays;
  trace(PathTracer(meshes, view, settings, isa));
  settings.ray_log = nullptr;
  const PathTracer tracer(meshes, view, settings, isa);
  std::vector<double> shares;
  std::size_t hits = 0;
  for (int i = 0; i < 5; ++i) {
    double start = thread_seconds();
    trace(tracer);
    const double paths = thread_seconds() - start;
    start = thread_seconds();
    for (const LoggedRay& ray : rays) {
      hits +=
          ray.is_shadow
              ? meshes.transmittance(ray.origin, ray.direction, ray.t_max, Passage::Panes, kMoment)
                        .x() > 0.0f
              : bool(meshes.intersect(ray.origin, ray.direction, ray.t_min, ray.t_max));
    }
    shares.push_back((thread_seconds() - start) / paths);
  }
  std::sort(shares.begin(), shares.end());
  return hits > 0 ? shares[shares.size() / 2] : 0.0;
}

/// Wall time from a change of the scene to the first ray: all that has a rigid body has moved.
double update_seconds(Scene& scene, PathRenderer& renderer) {
  std::vector<double> times;
  for (int i = 0; i < 25; ++i) {
    for (const NodeId node : scene.match("/room/*")) {
      if (!scene[node].rigid_body) continue;
      Affine pose = scene[node].parent_from_node;
      pose.translation().x() += i % 2 == 0 ? 0.01 : -0.01;
      pose.linear() = Mat3(Eigen::AngleAxisd(0.02, Vec3::UnitY())) * pose.linear();
      scene.set_pose(node, pose);
    }
    const auto start = std::chrono::steady_clock::now();
    renderer.prepare(scene);
    times.push_back(
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

struct Options {
  std::string folder;
  std::string reference;
  std::string png;
  std::string raw;
  std::string materials = "diffuse";
  int width = 320;
  int height = 240;
  int threads = 2;
  int repetitions = 1;
  bool probes = false;
  int device = -1;  ///< Of Vulkan; -1: none.
  bool ray_query = false;
  std::uint64_t seed = 1;
  EmbreeRenderer::Params params;
};

std::unique_ptr<PathRenderer> make_renderer(const Options& options, Host& host) {
#ifdef DIORAMA_HAS_VULKAN
  if (options.device >= 0) {
    VulkanRenderer::Params params;
    static_cast<PictureParams&>(params) = options.params;
    params.device = options.device;
    params.ray_query = options.ray_query;
    return std::make_unique<VulkanRenderer>(params, host);
  }
#endif
  return std::make_unique<EmbreeRenderer>(options.params, host);
}

void run(const Options& options) {
  test::RenderHost host(options.threads);
  double start = cpu_seconds();
  Scene scene = bench::load_bench_scene(options.folder, host, options.materials == "diffuse");
  const NodeId camera =
      bench::add_bench_camera(options.folder, scene, options.width, options.height);
  const double load = cpu_seconds() - start;
  start = cpu_seconds();
  const std::unique_ptr<PathRenderer> made = make_renderer(options, host);
  PathRenderer& renderer = *made;
  const double make = cpu_seconds() - start;
  start = cpu_seconds();
  renderer.prepare(scene);
  const double prepare = cpu_seconds() - start;
  std::optional<Image<Vec3f>> reference;
  if (!options.reference.empty()) {
    reference = read_linear_picture(options.reference, options.width, options.height, host);
  }
  for (int i = 0; i < options.repetitions; ++i) {
    start = cpu_seconds();
    const Frame frame = renderer.render({camera,
                                         {std::string(kColorHdr.name), std::string(kColor.name)},
                                         options.seed + unsigned(i)});
    const double cpu = cpu_seconds() - start;
    const auto& counts = renderer.last_counts();
    nlohmann::ordered_json line;
    line["materials"] = options.materials;
    line["size"] = std::to_string(options.width) + "x" + std::to_string(options.height);
    if (options.device >= 0) line["device"] = options.device;
    line["samples"] = options.params.samples;
    line["denoise"] = options.params.denoise;
    line["load_cpu_s"] = load;
    line["make_cpu_s"] = make;
    line["prepare_cpu_s"] = prepare;
    line["frame_cpu_s"] = cpu;
    line["trace_wall_s"] = counts.trace_s;
    line["denoise_wall_s"] = counts.denoise_s;
    line["paths_per_cpu_s"] = double(counts.paths) / cpu;
    line["rays_per_path"] = double(counts.rays) / double(counts.paths);
    line["shadow_rays_per_path"] = double(counts.shadow_rays) / double(counts.paths);
    line["mrays_per_cpu_s"] = 1e-6 * double(counts.rays + counts.shadow_rays) / cpu;
    line["mrays_per_wall_s"] = 1e-6 * double(counts.rays + counts.shadow_rays) / counts.trace_s;
    for (const auto& [work, seconds] : counts.device_s) line["device_s"][work] = seconds;
    if (reference) {
      const auto error = bench::picture_error(frame.get(kColorHdr), *reference);
      line["rel_mse"] = error.trimmed_mse;
      line["bias"] = error.bias;
    }
    std::printf("%s\n", line.dump().c_str());
    if (!options.raw.empty()) {
      const auto pixels = frame.get(kColorHdr).pixels();
      std::ofstream(options.raw, std::ios::binary)
          .write(reinterpret_cast<const char*>(pixels.data()),
                 std::streamsize(pixels.size_bytes()));
    }
    if (!options.png.empty()) test::write_png(host, frame.get(kColor), options.png);
  }
  if (options.probes) {
    // Last, because the second moves things.
    nlohmann::ordered_json line;
    if (options.device < 0)
      line["raw_ray_share"] = share_of_raw_rays(scene, camera, host, options.params);
    line["update_wall_s"] = update_seconds(scene, renderer);
    for (const auto& [phase, seconds] : renderer.report().seconds)
      line["update_s"][phase] = seconds;
    std::printf("%s\n", line.dump().c_str());
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  options.params.max_bounces = 4;
  options.params.caustics = true;
  options.params.denoise = false;
  options.params.samples = 64;
  CLI::App app{"Renders the bench scene; prints one JSON line per picture"};
  app.add_option("folder", options.folder, "Holds scene.glb, scene.json, sky.hdr")->required();
  app.add_option("--reference", options.reference, "EXR of the same size to compare with");
  app.add_option("--png", options.png, "Where to put the picture");
  app.add_option("--raw", options.raw, "Where to put the radiance: floats, RGB, rows from the top");
  app.add_option("--materials", options.materials)->check(CLI::IsMember({"diffuse", "pbr"}));
  app.add_option("--width", options.width);
  app.add_option("--height", options.height);
  app.add_option("--samples", options.params.samples);
  app.add_option("--bounces", options.params.max_bounces);
  app.add_option("--threads", options.threads);
  app.add_option("--repetitions", options.repetitions);
  app.add_option("--seed", options.seed);
#ifdef DIORAMA_HAS_VULKAN
  app.add_option("--device", options.device, "Vulkan device that traces the paths");
  app.add_flag("--ray-query", options.ray_query, "Trace by the device's own ray queries");
#endif
  app.add_flag("--probes", options.probes,
               "Also compare with Embree alone and time the update of a scene whose things moved");
  app.add_option("--mode", options.params.mode);
  app.add_option("--isa", options.params.isa);
  app.add_option("--sphere-lights", options.params.sphere_lights);
  app.add_option("--principled", options.params.principled);
  app.add_flag("--denoise,!--no-denoise", options.params.denoise);
  app.add_flag("--path-reuse,!--no-path-reuse", options.params.path_reuse);
  app.add_flag("--caustics,!--no-caustics", options.params.caustics);
  CLI11_PARSE(app, argc, argv);
  try {
    run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
