// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_bench.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "framework/app/standard_output.h"
#include "framework/bench/picture_error.h"
#include "framework/bench/scene_rig.h"
#include "framework/host/machine_limits.h"
#include "framework/host/replace_file.h"
#include "framework/images/linear_picture.h"
#include "framework/jobs/assemble.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

using OrderedJson = nlohmann::ordered_json;

/// Wall and CPU time of one step.
struct StepTime {
  double wall_s = 0.0;
  double cpu_s = 0.0;
};

template <class Step>
StepTime measured(Step&& step) {
  const double cpu = cpu_seconds();
  const auto start = std::chrono::steady_clock::now();
  step();
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  return {wall.count(), cpu_seconds() - cpu};
}

/// One picture.
struct BenchRun {
  StepTime render;
  StepTime encode;
  RenderReport report;
  std::optional<bench::PictureError> error;
};

struct BenchResult {
  int width = 0;
  int height = 0;
  StepTime load;
  StepTime prepare;
  std::vector<std::pair<std::string, double>> prepare_phases;
  std::vector<BenchRun> runs;
};

std::shared_ptr<const Material> matte(const Material& source) {
  auto material = std::make_shared<Material>();
  material->name = source.name;
  material->base_color = source.base_color;
  material->base_color_texture = source.base_color_texture;
  material->metallic = 0.0f;
  material->roughness = 1.0f;
  material->specular = 0.0f;
  return material;
}

void make_matte(Scene& scene) {
  std::map<const Material*, std::shared_ptr<const Material>> made;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (!scene[node].mesh) continue;
    for (auto& material : scene.edit(node).materials) {
      if (!material) continue;
      auto& replacement = made[material.get()];
      if (!replacement) replacement = matte(*material);
      material = replacement;
    }
  }
}

/// A generated room, seen from one of its corners, where nothing is asked for.
BenchOptions with_scene(BenchOptions options) {
  PictureOptions& picture = options.picture;
  if (!picture.asset.empty()) return options;
  picture.asset = "dining_room:7";
  if (picture.eye.empty()) picture.eye = {6.4, 6.3, 1.7};
  if (picture.target.empty()) picture.target = {8.9, 8.1, 0.8};
  return options;
}

NodeId load_scene(const BenchOptions& options, Scene& scene, Host& host, const Log& log) {
  if (options.lights.empty()) {
    const NodeId camera = load_picture_scene(options.picture, scene, host, log);
    if (options.is_diffuse) make_matte(scene);
    return camera;
  }
  host.load_asset(options.picture.asset, scene, scene.root());
  for (const NodeId node : scene.subtree(scene.root())) scene.edit(node).light.reset();
  if (options.is_diffuse) make_matte(scene);
  bench::add_rig_lights(options.lights, scene, host);
  const NodeId camera = bench::add_rig_camera(options.lights, scene);
  resize_camera(options.picture, camera, scene);
  return camera;
}

/// The same picture with many samples and another noise pattern, without denoising.
Image<Vec3f> make_reference(const BenchOptions& options, const Scene& scene, NodeId camera,
                            Registry& registry, Host& host) {
  PictureOptions picture = options.picture;
  picture.sets.push_back("samples=" + std::to_string(options.reference_samples));
  picture.sets.emplace_back("denoise=false");
  const auto renderer = make_renderer(picture, registry, host);
  renderer->prepare(scene);
  constexpr std::uint64_t kOtherPattern = 0x9E3779B97F4A7C15u;
  return renderer
      ->render({camera, {std::string(kColorHdr.name)}, options.picture.seed ^ kOtherPattern})
      .get(kColorHdr);
}

template <class Value>
double median(const std::vector<BenchRun>& runs, const Value& value) {
  std::vector<double> values;
  for (const BenchRun& run : runs) values.push_back(value(run));
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

OrderedJson step_json(const StepTime& time) {
  return {{"wall_s", time.wall_s}, {"cpu_s", time.cpu_s}};
}

OrderedJson run_json(const BenchRun& run) {
  OrderedJson json;
  json["render"] = step_json(run.render);
  json["encode"] = step_json(run.encode);
  for (const auto& [phase, seconds] : run.report.seconds) json["render_phases_s"][phase] = seconds;
  json["paths"] = run.report.paths;
  json["rays"] = run.report.rays;
  json["paths_per_s"] = double(run.report.paths) / run.render.wall_s;
  json["rays_per_s"] = double(run.report.rays) / run.render.wall_s;
  json["paths_per_cpu_s"] = double(run.report.paths) / run.render.cpu_s;
  json["rays_per_cpu_s"] = double(run.report.rays) / run.render.cpu_s;
  if (run.error) {
    json["rmse"] = run.error->rmse;
    json["rel_mse"] = run.error->relative_mse;
    json["rel_mse_trimmed"] = run.error->trimmed_mse;
    json["bias"] = run.error->bias;
  }
  return json;
}

std::string result_json(const BenchOptions& options, const BenchResult& result) {
  OrderedJson json;
  json["scene"] = options.picture.asset;
  json["renderer"] = options.picture.renderer;
  json["parameters"] = options.picture.sets;
  json["width"] = result.width;
  json["height"] = result.height;
  json["load"] = step_json(result.load);
  json["prepare"] = step_json(result.prepare);
  for (const auto& [phase, seconds] : result.prepare_phases) {
    json["prepare_phases_s"][phase] = seconds;
  }
  json["runs"] = OrderedJson::array();
  for (const BenchRun& run : result.runs) json["runs"].push_back(run_json(run));
  return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string time_line(const std::string& name, double wall_s, std::optional<double> cpu_s) {
  char line[96];
  if (cpu_s) {
    std::snprintf(line, sizeof line, "%-26s %9.3f s %9.3f CPU s\n", name.c_str(), wall_s, *cpu_s);
  } else {
    std::snprintf(line, sizeof line, "  %-24s %9.3f s\n", name.c_str(), wall_s);
  }
  return line;
}

/// Medians over the runs.
std::string result_text(const BenchOptions& options, const BenchResult& result) {
  const auto& runs = result.runs;
  std::string text = options.picture.asset + ", " + std::to_string(result.width) + "x" +
                     std::to_string(result.height) + ", " + options.picture.renderer + ", " +
                     std::to_string(runs.size()) +
                     (runs.size() == 1 ? " picture\n" : " pictures\n");
  text += time_line("load", result.load.wall_s, result.load.cpu_s);
  text += time_line("prepare", result.prepare.wall_s, result.prepare.cpu_s);
  for (const auto& [phase, seconds] : result.prepare_phases) {
    text += time_line(phase, seconds, std::nullopt);
  }
  const double wall = median(runs, [](const BenchRun& r) { return r.render.wall_s; });
  const double cpu = median(runs, [](const BenchRun& r) { return r.render.cpu_s; });
  text += time_line("render", wall, cpu);
  const auto& phases = runs.front().report.seconds;
  for (std::size_t i = 0; i < phases.size(); ++i) {
    text += time_line(phases[i].first,
                      median(runs, [&](const BenchRun& r) { return r.report.seconds[i].second; }),
                      std::nullopt);
  }
  text += time_line("encode", median(runs, [](const BenchRun& r) { return r.encode.wall_s; }),
                    median(runs, [](const BenchRun& r) { return r.encode.cpu_s; }));
  char line[160];
  if (const RenderReport& report = runs.front().report; report.paths > 0) {
    std::snprintf(line, sizeof line,
                  "%.3g paths/s, %.3g rays/s, %.2f rays per path; per CPU second %.3g and %.3g\n",
                  double(report.paths) / wall, double(report.rays) / wall,
                  double(report.rays) / double(report.paths), double(report.paths) / cpu,
                  double(report.rays) / cpu);
    text += line;
  }
  if (runs.front().error) {
    const auto middle = [&](double bench::PictureError::*member) {
      return median(runs, [&](const BenchRun& r) { return (*r.error).*member; });
    };
    std::snprintf(line, sizeof line,
                  "RMSE %.4g, relMSE %.4g (%.4g without the worst thousandth), bias %+.2f %%\n",
                  middle(&bench::PictureError::rmse), middle(&bench::PictureError::relative_mse),
                  middle(&bench::PictureError::trimmed_mse),
                  100.0 * middle(&bench::PictureError::bias));
    text += line;
  }
  return text;
}

}  // namespace

int command_bench(const GlobalOptions& global, const BenchOptions& given, ConsoleLog& log) {
  const BenchOptions options = with_scene(given);
  if (!options.reference.empty() && options.reference_samples > 0) {
    throw Error(ErrorKind::Usage, "--reference and --reference-samples exclude each other");
  }
  const JobServices services = make_services(global, log.sink());
  const std::unique_ptr<Renderer> renderer =
      make_renderer(options.picture, *services.registry, *services.host);
  const std::string who = "renderer '" + options.picture.renderer + "'";

  BenchResult result;
  Scene scene;
  NodeId camera;
  result.load = measured([&] { camera = load_scene(options, scene, *services.host, log.sink()); });
  result.width = scene[camera].camera->width;
  result.height = scene[camera].camera->height;
  std::optional<Image<Vec3f>> reference;
  if (!options.reference.empty()) {
    reference = read_linear_picture(options.reference, result.width, result.height, *services.host);
  }
  result.prepare = measured([&] { call_component(who, [&] { renderer->prepare(scene); }); });
  result.prepare_phases = renderer->report().seconds;
  if (options.reference_samples > 0) {
    reference = make_reference(options, scene, camera, *services.registry, *services.host);
  }
  for (int i = 0; i < options.repetitions; ++i) {
    BenchRun& run = result.runs.emplace_back();
    const RenderRequest request{camera,
                                {std::string(kColor.name), std::string(kColorHdr.name)},
                                options.picture.seed + std::uint64_t(i)};
    Frame frame;
    run.render =
        measured([&] { frame = call_component(who, [&] { return renderer->render(request); }); });
    run.report = renderer->report();
    const Image<Rgba8>& picture = frame.get(kColor);
    run.encode = measured([&] {
      services.host->encode_image(
          {picture.pixels().data(), picture.width(), picture.height(), 4, 8}, ImageFormat::Png);
    });
    const Image<Vec3f>& light = frame.get(kColorHdr);
    if (reference) run.error = bench::picture_error(light, *reference);
    if (i + 1 < options.repetitions || options.picture_file.empty()) continue;
    replace_file(
        options.picture_file,
        services.host->encode_image({light.pixels().data(), light.width(), light.height(), 3, 32},
                                    ImageFormat::Exr));
  }
  if (options.as_json) {
    std::cout << result_json(options, result);
  } else {
    print_text(result_text(options, result));
  }
  return 0;
}

}  // namespace diorama
