// SPDX-License-Identifier: Apache-2.0
// What labels and files cost beside a frame of the bench scene, in CPU seconds of one run: the
// renderer's geometry channels, every annotator and coverage against the colour alone
// (labels_per_color), and BasicWriter with every annotator in its encoding (files_per_color). Then
// whole frames as a run makes them, with what BasicWriter asks for and files written beside the
// next frame: their CPU seconds and how many there are per second of wall time (frame_cpu_s,
// frames_per_s).
//
//   labels_bench BENCH_FOLDER --real-time --repetitions 20
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <future>
#include <nlohmann/json.hpp>

#include "bench_scene.h"
#include "embree_renderer.h"
#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/motion.h"
#include "framework/annotators/object_coordinates.h"
#include "framework/annotators/visibility.h"
#include "framework/host/machine_limits.h"
#include "support/render_host/render_host.h"
#include "writer_basic/basic_writer.h"

namespace {

using namespace diorama;

/// Median CPU seconds of each step.
class Times {
 public:
  template <class Step>
  auto measure(const std::string& name, Step&& step) {
    const double start = cpu_seconds();
    auto result = step();
    times_[name].push_back(cpu_seconds() - start);
    return result;
  }
  double median(const std::string& name) {
    auto& list = times_.at(name);
    std::sort(list.begin(), list.end());
    return list[list.size() / 2];
  }
  nlohmann::ordered_json medians() {
    nlohmann::ordered_json json;
    for (const auto& [name, list] : times_) json[name + "_cpu_s"] = median(name);
    return json;
  }

 private:
  std::map<std::string, std::vector<double>> times_;
};

/// Counts bytes and forgets them.
class ForgottenFiles final : public CaptureFiles {
 public:
  void add(std::string_view, std::vector<std::byte> bytes) override { size += bytes.size(); }
  void append(std::string_view, std::span<const std::byte> bytes) override { size += bytes.size(); }
  void append_kept(std::string_view, int) override {}
  void record(std::string_view) override {}
  void keep(std::span<const std::byte> bytes) override { size += bytes.size(); }
  std::size_t size = 0;
};

BasicWriter::Params all_annotators() {
  BasicWriter::Params p;
  p.rgb = p.bounding_box_2d_tight = p.bounding_box_2d_loose = p.semantic_segmentation = true;
  p.instance_id_segmentation = p.instance_segmentation = p.distance_to_camera = true;
  p.distance_to_image_plane = p.bounding_box_3d = p.occlusion = p.normals = true;
  p.motion_vectors = p.camera_params = p.pointcloud = true;
  return p;
}

/// Every mesh is an object of its own; every second one moves.
BodyPoses label_everything(Scene& scene) {
  int number = 0;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (!scene[node].mesh) continue;
    scene.edit(node).labels = {{"class", "object_" + std::to_string(number)}};
    if (++number % 2 == 0) scene.edit(node).rigid_body = RigidBody{};
  }
  BodyPoses before = body_poses(scene);
  for (auto& [node, pose] : before) pose.translation().z() += 0.01;
  return before;
}

struct Options {
  std::string folder;
  int width = 640;
  int height = 480;
  int threads = 2;
  int repetitions = 3;
  std::string lens = "pinhole";
  bool is_real_time = false;
  EmbreeRenderer::Params params;
};

void set_lens(Camera& camera, const std::string& lens) {
  if (lens == "opencv") {
    camera.lens = LensModel::OpencvPinhole;
    camera.distortion = {-0.1, 0.02, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0};
  } else if (lens == "fisheye") {
    camera.lens = LensModel::FisheyePolynomial;
    camera.fisheye_polynomial = {0.0, 1.0 / camera.fx, 0.0, 0.0, 0.0, 0.0};
  }
}

/// `extras`: what BasicWriter does not ask for.
void annotate(const Scene& scene, const BodyPoses& before, EmbreeRenderer& renderer, NodeId camera,
              Host& host, bool extras, Frame& frame, Times& times) {
  times.measure("instances", [&] {
    InstanceIds({}, host).annotate(scene, frame);
    Instances({}, host).annotate(scene, frame);
    return 0;
  });
  const auto masks =
      times.measure("cover", [&] { return renderer.cover(camera, labelled_instances(scene)); });
  times.measure("other_annotators", [&] {
    measure_visibility(masks, extras, frame);
    measure_motion(scene, before, frame);
    if (extras) ObjectCoordinates({}, host).annotate(scene, frame);
    return 0;
  });
}

/// Whole frames, with files encoded by a thread of their own.
void measure_frames(const Scene& scene, const BodyPoses& before, EmbreeRenderer& renderer,
                    NodeId camera, Host& host, BasicWriter& writer, int count,
                    nlohmann::ordered_json& line) {
  NameSet channels{std::string(kLeafId.name)};
  const NameSet known = renderer.provides();
  for (const std::string& name : writer.needs()) {
    if (known.contains(name)) channels.insert(name);
  }
  Times times;
  ForgottenFiles files;
  std::future<void> written;
  const double cpu_start = cpu_seconds();
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < count; ++i) {
    Capture capture;
    capture.index = i;
    capture.frames.push_back(renderer.render({camera, channels, std::uint64_t(i)}));
    annotate(scene, before, renderer, camera, host, false, capture.frames.back(), times);
    if (written.valid()) written.get();
    written = std::async(std::launch::async, [&writer, &files, capture = std::move(capture)] {
      writer.write(capture, files);
    });
  }
  written.get();
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  line["frame_cpu_s"] = (cpu_seconds() - cpu_start) / count;
  line["frames_per_s"] = count / wall.count();
}

void run(const Options& options) {
  test::RenderHost host(options.threads);
  Scene scene = bench::load_bench_scene(options.folder, host, false);
  const NodeId camera =
      bench::add_bench_camera(options.folder, scene, options.width, options.height);
  set_lens(*scene.edit(camera).camera, options.lens);
  const BodyPoses before = label_everything(scene);
  EmbreeRenderer renderer(options.params, host);
  renderer.prepare(scene);
  const NameSet color{std::string(kColor.name), std::string(kColorHdr.name)};
  NameSet geometry = renderer.provides();
  for (const std::string& name : color) geometry.erase(name);

  BasicWriter writer(all_annotators(), host);
  DatasetInfo dataset;
  dataset.capture_count = options.repetitions;
  dataset.camera_names = {"camera"};
  ForgottenFiles files;
  writer.begin(dataset, files);
  Times times;
  for (int i = 0; i < options.repetitions; ++i) {
    Frame picture = times.measure("color", [&] {
      return renderer.render({camera, color, std::uint64_t(i)});
    });
    Capture capture;
    capture.index = i;
    capture.frames.push_back(times.measure("channels", [&] {
      return renderer.render({camera, geometry, std::uint64_t(i)});
    }));
    Frame& frame = capture.frames.back();
    annotate(scene, before, renderer, camera, host, true, frame, times);
    frame.set(kColor, Image<Rgba8>(picture.get(kColor)));
    frame.set(kColorHdr, Image<Vec3f>(picture.get(kColorHdr)));
    times.measure("files", [&] {
      writer.write(capture, files);
      return 0;
    });
  }
  nlohmann::ordered_json line = times.medians();
  double labels = 0.0;
  for (const char* part : {"channels", "instances", "cover", "other_annotators"}) {
    labels += times.median(part);
  }
  measure_frames(scene, before, renderer, camera, host, writer, options.repetitions, line);
  line["size"] = std::to_string(options.width) + "x" + std::to_string(options.height);
  line["mode"] = options.params.mode;
  line["samples"] = options.params.samples;
  line["lens"] = options.lens;
  line["instances"] = labelled_instances(scene).size();
  line["labels_per_color"] = labels / times.median("color");
  line["files_per_color"] = times.median("files") / times.median("color");
  line["mb_per_frame"] = 1e-6 * double(files.size) / options.repetitions;
  std::printf("%s\n", line.dump(2).c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  options.params.samples = 64;
  options.params.max_bounces = 4;
  options.params.denoise = false;
  CLI::App app{"Prints what labels and files cost as shares of a path-traced frame's CPU time"};
  app.add_option("folder", options.folder, "Holds scene.glb, scene.json, sky.hdr")->required();
  app.add_option("--width", options.width);
  app.add_option("--height", options.height);
  app.add_option("--samples", options.params.samples);
  app.add_option("--threads", options.threads);
  app.add_option("--repetitions", options.repetitions);
  app.add_option("--lens", options.lens)->check(CLI::IsMember({"pinhole", "opencv", "fisheye"}));
  app.add_flag("--real-time", options.is_real_time, "The mode of that name, with one path");
  CLI11_PARSE(app, argc, argv);
  if (options.is_real_time) {
    options.params.mode = "real_time";
    options.params.samples = 1;
  }
  try {
    run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
