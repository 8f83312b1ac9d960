// SPDX-License-Identifier: Apache-2.0
#include "framework/replicator/object_based.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>

#include "framework/replicator/translator.h"

namespace diorama {
namespace {

using replicator::native;
using replicator::numbered;
using replicator::numbers;
using replicator::texts;

constexpr std::uint64_t kObjectBasedSeed = 42;
constexpr double kStepsPerSecond = 60.0;
// Every fifth frame of the reference is exposed while its simulation goes on.
constexpr int kFramesPerExposure = 5;
constexpr double kExposureS = 0.025;

constexpr const char* kIndoorSkies[] = {"/NVIDIA/Assets/Skies/Indoor/autoshop_01_4k.hdr",
                                        "/NVIDIA/Assets/Skies/Indoor/carpentry_shop_01_4k.hdr",
                                        "/NVIDIA/Assets/Skies/Indoor/hotel_room_4k.hdr",
                                        "/NVIDIA/Assets/Skies/Indoor/wooden_lounge_4k.hdr"};

const std::vector<std::string>& object_based_keys() {
  static const std::vector<std::string> keys{"launch_config",
                                             "env_url",
                                             "working_area_size",
                                             "rt_subframes",
                                             "num_frames",
                                             "num_cameras",
                                             "camera_collider_radius",
                                             "disable_render_products_between_captures",
                                             "simulation_duration_between_captures",
                                             "resolution",
                                             "camera_properties_kwargs",
                                             "camera_look_at_target_offset",
                                             "camera_distance_to_target_min_max",
                                             "writer_type",
                                             "writer_kwargs",
                                             "labeled_assets_and_properties",
                                             "shape_distractors_types",
                                             "shape_distractors_scale_min_max",
                                             "shape_distractors_num",
                                             "mesh_distractors_urls",
                                             "mesh_distractors_scale_min_max",
                                             "mesh_distractors_num"};
  return keys;
}

/// The keys at the top that are numbers, words or lists of them.
struct ObjectBasedKeys {
  std::string env_url;
  std::vector<double> working_area_size{4, 4, 3};
  int rt_subframes = -1;
  int num_frames = 0;
  int num_cameras = 0;
  double camera_collider_radius = 0.0;
  bool disable_render_products = false;
  double simulation_duration = 0.0;
  std::vector<double> resolution{640, 480};
  double look_at_offset = 0.0;
  Range distance;
  std::vector<std::string> shape_types;
  Range shape_scale;
  int shape_num = 0;
  std::vector<std::string> mesh_urls;
  Range mesh_scale;
  int mesh_num = 0;
  void visit(ParamVisitor& v) {
    v.param("env_url", env_url, {"The environment; empty: none."});
    v.param("working_area_size", working_area_size, {"Width, depth, height.", "m", 0.01, 1e5});
    v.param("rt_subframes", rt_subframes, {"Quality of a frame; -1: one.", "", -1, 1e5});
    v.param("num_frames", num_frames, {"Frames of each camera.", "", 1, 1e6});
    v.param("num_cameras", num_cameras, {"Cameras.", "", 1, 1e4});
    v.param("camera_collider_radius", camera_collider_radius,
            {"Of the spheres that push objects away from cameras.", "m", 0, 1e3});
    v.param("disable_render_products_between_captures", disable_render_products,
            {"No effect here."});
    v.param("simulation_duration_between_captures", simulation_duration,
            {"Simulated time between frames.", "s", 0, 1e4});
    v.param("resolution", resolution, {"Width and height.", "px", 1, 16384});
    v.param("camera_look_at_target_offset", look_at_offset, {"Jitter per axis.", "m", 0, 1e4});
    v.param("camera_distance_to_target_min_max", distance, {"Of the cameras.", "m", 1e-3, 1e5});
    v.param("shape_distractors_types", shape_types, {"Shapes."});
    v.param("shape_distractors_scale_min_max", shape_scale, {"Scale.", "", 1e-4, 1e4});
    v.param("shape_distractors_num", shape_num, {"Objects.", "", 0, 1e5});
    v.param("mesh_distractors_urls", mesh_urls, {"Assets."});
    v.param("mesh_distractors_scale_min_max", mesh_scale, {"Scale.", "", 1e-4, 1e4});
    v.param("mesh_distractors_num", mesh_num, {"Objects.", "", 0, 1e5});
  }
};

struct LabeledAssetBlock {
  std::string url;
  std::string label = "unknown";
  int count = 1;
  bool floating = false;
  std::optional<Range> scale;
  Range scale_min_max{1.0, 1.0};
  Range randomize_scale{1.0, 1.0};
  void visit(ParamVisitor& v) {
    v.param("url", url, {"The asset."});
    v.param("label", label, {"Its label."});
    v.param("count", count, {"Objects.", "", 0, 1e5});
    v.param("floating", floating, {"Without gravity."});
    v.param("scale_min_max", scale_min_max, {"Scale, as the files call it.", "", 1e-4, 1e4});
    v.param("randomize_scale", randomize_scale, {"Scale, as the program calls it.", "", 1e-4, 1e4});
  }
};

/// Properties of cameras; newer files write focal_length, older ones USD's focalLength.
struct CameraProperties {
  double focal_length = 24.0;
  double focus_distance = 400.0;
  double f_stop = 0.0;
  double horizontal_aperture = 20.955;
  Range clipping_range{1.0, 1e6};
  double vertical_aperture = 0.0;
  void visit(ParamVisitor& v) {
    for (const char* key : {"focalLength", "focal_length"}) {
      v.param(key, focal_length, {"Focal length.", "mm", 0.01, 1e5});
    }
    for (const char* key : {"focusDistance", "focus_distance"}) {
      v.param(key, focus_distance, {"Distance in focus.", "m", 0, 1e6});
    }
    for (const char* key : {"fStop", "f_stop"}) {
      v.param(key, f_stop, {"0: everything is in focus.", "", 0, 1e3});
    }
    for (const char* key : {"horizontalAperture", "horizontal_aperture"}) {
      v.param(key, horizontal_aperture, {"Width of the sensor.", "mm", 0.01, 1e5});
    }
    for (const char* key : {"clippingRange", "clipping_range"}) {
      v.param(key, clipping_range, {"What cameras see.", "m", 1e-5, 1e9});
    }
    for (const char* key : {"verticalAperture", "vertical_aperture"}) {
      v.param(key, vertical_aperture, {"No effect: pixels are square.", "mm", 0, 1e5});
    }
  }
};

/// What the application is started with, as SimulationApp knows it.
const std::vector<std::string>& launch_keys() {
  static const std::vector<std::string> keys{"renderer",
                                             "headless",
                                             "hide_ui",
                                             "active_gpu",
                                             "physics_gpu",
                                             "multi_gpu",
                                             "max_gpu_count",
                                             "sync_loads",
                                             "width",
                                             "height",
                                             "window_width",
                                             "window_height",
                                             "display_options",
                                             "anti_aliasing",
                                             "subdiv_refinement_level",
                                             "denoiser",
                                             "max_bounces",
                                             "samples_per_pixel_per_frame",
                                             "open_usd",
                                             "livesync_usd",
                                             "max_specular_transmission_bounces",
                                             "max_volume_bounces",
                                             "fast_shutdown",
                                             "profiler_backend",
                                             "create_new_stage",
                                             "extra_args",
                                             "limit_cpu_threads",
                                             "experience",
                                             "enable_motion_bvh",
                                             "disable_viewport_updates"};
  return keys;
}

/// A part of a path and of a pattern.
std::string plain_name(const std::string& label) {
  std::string name;
  for (const char c : label) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-';
    name += is_plain ? c : '_';
  }
  return name.empty() ? "object" : name;
}

Value range(const Range& value) { return numbers({value.lo, value.hi}); }

class ObjectBasedTranslator : private replicator::Translator {
 public:
  ObjectBasedTranslator(const Value& job, Diagnostics& diagnostics)
      : Translator(job, builtin_object_based_job(), "object_based_default.yaml", diagnostics) {}

  ReplicatorTranslation translate() {
    complain_about_unknown(*given_, "", object_based_keys());
    read_keys();
    const std::vector<LabeledAsset> assets = labeled_assets();
    check_targets(assets);
    set("seed", Value::integer(std::int64_t(kObjectBasedSeed)));
    set("total_captures", Value::integer(keys_.num_frames));
    add_environment();
    add_objects(assets);
    add_lights();
    add_cameras();
    add_randomizers(assets);
    // Nothing slows down what floats, and things part as fast as PhysX lets them.
    set("physics", native("{type: bullet, floating_damping: 0, max_depenetration_speed: 3}"));
    add_renderer();
    add_timeline();
    // Things drift and bounce to the end: nothing is to come to rest.
    set("settle", native("{policy: keep}"));
    add_writer();
    return std::move(result_);
  }

 private:
  struct LabeledAsset {
    const Value* source = nullptr;
    std::string name;
    std::string under;
    LabeledAssetBlock keys;
  };

  void read_keys() {
    Value flat = Value::make_map();
    flat.place = given_->place;
    for (const std::string& key : object_based_keys()) {
      const bool is_block = key == "launch_config" || key == "camera_properties_kwargs" ||
                            key == "writer_type" || key == "writer_kwargs" ||
                            key == "labeled_assets_and_properties";
      if (is_block) continue;
      const Value& value = section(key);
      const bool is_nothing = value.kind == Value::Kind::Null;
      if (key == "env_url" && is_nothing) continue;
      flat.set(key, value);
    }
    ParamReader reader(flat, "", diagnostics_);
    keys_.visit(reader);
    reader.finish();
    // What was complained about has no need of errors that follow from it.
    keys_.num_frames = std::max(1, keys_.num_frames);
    keys_.num_cameras = std::max(1, keys_.num_cameras);
    read_shape_types();
    if (keys_.mesh_num > 0 && keys_.mesh_urls.empty()) {
      complain_about_none("mesh_distractors_urls", "mesh_distractors_num", keys_.mesh_num);
      keys_.mesh_num = 0;
    }
    check_resolution(keys_.resolution, section("resolution").place, "resolution");
    if (keys_.working_area_size.size() != 3) {
      diagnostics_.add(section("working_area_size").place,
                       "working_area_size: expected [width, depth, height] in metres");
      keys_.working_area_size = {1.0, 1.0, 1.0};
    }
    if (given_->find("disable_render_products_between_captures")) {
      result_.without_effect.push_back(
          "disable_render_products_between_captures (nothing is rendered between captures in any "
          "case)");
    }
  }

  /// The program takes 'Cube' and 'CUBE' for 'cube'.
  void read_shape_types() {
    for (std::string& type : keys_.shape_types) {
      std::ranges::transform(type, type.begin(),
                             [](unsigned char c) { return char(std::tolower(c)); });
    }
    if (keys_.shape_num == 0 || !keys_.shape_types.empty()) return;
    complain_about_none("shape_distractors_types", "shape_distractors_num", keys_.shape_num);
    keys_.shape_num = 0;
  }

  void complain_about_none(const std::string& key, const std::string& count_key, int count) {
    if (section(key).kind == Value::Kind::Scalar || section(key).kind == Value::Kind::Map) return;
    diagnostics_.add(section(key).place,
                     key + ": there are none, but " + count_key + " is " + std::to_string(count));
  }

  /// Each of the cameras looks at one of the objects.
  void check_targets(const std::vector<LabeledAsset>& assets) {
    const auto is_there = [](const LabeledAsset& asset) { return asset.keys.count > 0; };
    const Value& list = section("labeled_assets_and_properties");
    if (list.kind == Value::Kind::Scalar || list.kind == Value::Kind::Map ||
        std::ranges::any_of(assets, is_there)) {
      return;
    }
    diagnostics_.add(list.place,
                     "labeled_assets_and_properties: there is no object for cameras to look at");
  }

  std::vector<LabeledAsset> labeled_assets() {
    std::vector<LabeledAsset> assets;
    const char* key = "labeled_assets_and_properties";
    const Value& list = section(key);
    if (list.kind == Value::Kind::Null) return assets;
    if (list.kind != Value::Kind::List) {
      diagnostics_.add(
          list.place, std::string(key) + ": expected a list of mappings, found " + list.describe());
      return assets;
    }
    std::map<std::string, int> uses;
    for (std::size_t i = 0; i < list.list.size(); ++i) {
      const Value& map = list.list[i];
      const std::string path = std::string(key) + "[" + std::to_string(i) + "]";
      LabeledAsset asset{&map, {}, {}, block<LabeledAssetBlock>(map, path)};
      if (map.kind == Value::Kind::Map) {
        if (asset.keys.url.empty()) diagnostics_.add(map.place, path + ": 'url' is missing");
        // The program's own word wins over the one that it never reads.
        asset.keys.scale =
            map.find("randomize_scale") ? asset.keys.randomize_scale : asset.keys.scale_min_max;
      }
      const std::string name = plain_name(asset.keys.label);
      asset.name = name + numbered(uses[name]++);
      asset.under = "/Assets/" + asset.name;
      assets.push_back(std::move(asset));
    }
    return assets;
  }

  void add_environment() {
    Value list = native("[{type: empty}]");
    Value rules = native("{colliders: none}");
    list.place = rules.place = section("env_url").place;
    if (!keys_.env_url.empty()) {
      list = native("[{type: files, name: environment}]");
      list.list[0].set("files", texts({keys_.env_url}));
      list.list[0].place = list.place = section("env_url").place;
    }
    rules.set("walls", numbers(keys_.working_area_size));
    set("environments", std::move(list));
    set("environment", std::move(rules));
  }

  void add_objects(const std::vector<LabeledAsset>& assets) {
    Value objects = Value::make_list();
    for (const LabeledAsset& asset : assets) {
      Value entry = object_entry(*asset.source, "files", asset.name, asset.under, asset.keys.count,
                                 asset.keys.floating ? 1.0 : 0.0);
      entry.set("label", Value::text(asset.keys.label));
      entry.set("files", texts({asset.keys.url}));
      objects.list.push_back(std::move(entry));
    }
    if (keys_.shape_num > 0) {
      Value entry = object_entry(section("shape_distractors_num"), "shapes", "shape_distractors",
                                 "/Distractors/Shapes", keys_.shape_num, 0.5);
      entry.set("shapes", texts(keys_.shape_types));
      objects.list.push_back(std::move(entry));
    }
    if (keys_.mesh_num > 0) {
      Value entry = object_entry(section("mesh_distractors_num"), "files", "mesh_distractors",
                                 "/Distractors/Meshes", keys_.mesh_num, 0.5);
      entry.set("files", texts(keys_.mesh_urls));
      objects.list.push_back(std::move(entry));
    }
    set("objects", std::move(objects));
  }

  void add_lights() {
    Value lights = native(
        "[{type: sphere, name: SphereLight, count: 3, radius_m: 0.5, visible_to_camera: false}, "
        "{type: dome, name: DomeLight}]");
    if (keys_.env_url.empty()) {
      lights.list.push_back(
          native("{type: distant, name: DistantLight, intensity: 400, rotation_deg: [0, 60, 0]}"));
    }
    set("lights", std::move(lights));
  }

  void add_cameras() {
    const Value& given = section("camera_properties_kwargs");
    const auto lens = block<CameraProperties>(given, "camera_properties_kwargs");
    for (const char* key : {"verticalAperture", "vertical_aperture"}) {
      if (!given.find(key)) continue;
      result_.without_effect.push_back(std::string("camera_properties_kwargs.") + key +
                                       " (pixels are square)");
    }
    Value camera = native("{type: pinhole, name: cam}");
    camera.place = given.place;
    camera.set("count", Value::integer(keys_.num_cameras));
    if (keys_.resolution.size() == 2) {
      camera.set("width", Value::integer(std::int64_t(keys_.resolution[0])));
      camera.set("height", Value::integer(std::int64_t(keys_.resolution[1])));
    }
    camera.set("focal_length_mm", Value::number(lens.focal_length));
    camera.set("horizontal_aperture_mm", Value::number(lens.horizontal_aperture));
    camera.set("f_stop", Value::number(lens.f_stop));
    camera.set("focus_distance_m", Value::number(lens.focus_distance));
    camera.set("near_m", Value::number(lens.clipping_range.lo));
    camera.set("far_m", Value::number(lens.clipping_range.hi));
    Value cameras = Value::make_list();
    cameras.place = given.place;
    cameras.list.push_back(std::move(camera));
    set("cameras", std::move(cameras));
    near_m_ = lens.clipping_range.lo;
  }

  /// Places all over the working area, from its centre.
  Value anywhere() const {
    Value list = Value::make_list();
    for (const double size : keys_.working_area_size) {
      list.list.push_back(numbers({-0.5 * size, 0.5 * size}));
    }
    return list;
  }

  Value scatter(const std::string& name, const std::string& under, const Range& scale) const {
    Value entry = native("{type: scatter_poses, on: [environment]}");
    entry.set("name", Value::text(name));
    entry.set("nodes", Value::text(under + "/*"));
    entry.set("offset", anywhere());
    entry.set("scale", range(scale));
    return entry;
  }

  /// What comes into a thin slab above the floor is thrown up.
  Value bounce() const {
    constexpr double kSlabM = 0.1;
    constexpr double kShare = 0.99;
    Value entry = native(
        "{type: random_velocities, name: bounce, on: [bounce], nodes: '/**', "
        "velocity: [[-2, 2], [-2, 2], [4, 8]]}");
    const std::vector<double>& size = keys_.working_area_size;
    const double middle = -0.5 * size[2] + 0.5 * kSlabM;
    const double half = 0.5 * kSlabM * kShare;
    const auto micrometres = [](double metres) { return std::round(metres * 1e6) / 1e6; };
    const double x = micrometres(0.5 * size[0] * kShare);
    const double y = micrometres(0.5 * size[1] * kShare);
    entry.set("box_min", numbers({-x, -y, micrometres(middle - half)}));
    entry.set("box_max", numbers({x, y, micrometres(middle + half)}));
    return entry;
  }

  Value orbit() const {
    Value entry = native(
        "{type: orbit_cameras, name: camera_poses, on: [cameras], nodes: '/Cameras/*', "
        "targets: '/Assets/*/*', cos_polar_angle: [-1, 1]}");
    entry.set("distance", range(keys_.distance));
    entry.set("look_at_offset", numbers({-keys_.look_at_offset, keys_.look_at_offset}));
    // Near planes cut nothing open; more would leave no place among so many things.
    entry.set("clearance_m", Value::number(std::clamp(near_m_, 0.02, 0.1)));
    return entry;
  }

  /// All cameras at every fifth frame.
  Value exposure() const {
    Value entry = native(
        "{type: camera_motion, name: motion_blur, on: [frame], nodes: '/Cameras/*', "
        "velocity: [0, 0, 0], angular_velocity_deg: [0, 0, 0]}");
    std::vector<double> times(std::size_t(kFramesPerExposure * keys_.num_cameras), 0.0);
    std::fill_n(times.begin(), keys_.num_cameras, kExposureS);
    Value items = Value::make_map();
    items.set("items", numbers(times));
    Value sequence = Value::make_map();
    sequence.set("sequence", std::move(items));
    entry.set("exposure_time_s", std::move(sequence));
    return entry;
  }

  void add_randomizers(const std::vector<LabeledAsset>& assets) {
    Value list = Value::make_list();
    if (!keys_.env_url.empty()) {
      list.list.push_back(
          native("{type: random_labels, name: no_labels, on: [environment], "
                 "nodes: '/Environment/**', mode: clear}"));
    }
    for (const LabeledAsset& asset : assets) {
      list.list.push_back(
          scatter(asset.name + "_poses", asset.under, asset.keys.scale.value_or(Range{1.0, 1.0})));
    }
    const bool has_distractors = keys_.shape_num > 0 || keys_.mesh_num > 0;
    if (keys_.mesh_num > 0) {
      list.list.push_back(
          scatter("mesh_distractor_poses", "/Distractors/Meshes", keys_.mesh_scale));
    }
    if (keys_.shape_num > 0) {
      list.list.push_back(
          scatter("shape_distractor_poses", "/Distractors/Shapes", keys_.shape_scale));
    }
    list.list.push_back(bounce());
    list.list.push_back(orbit());
    list.list.push_back(
        native("{type: pull_together, name: pull_targets, on: [frame], every: 10, "
               "nodes: '/Assets/*/*', strength: [0.1, 1]}"));
    if (has_distractors) {
      list.list.push_back(
          native("{type: pull_together, name: pull_distractors, on: [frame], every: 10, "
                 "nodes: '/Distractors/*/*', strength: [0.1, 1]}"));
    }
    Value lights = native(
        "{type: scatter_lights, name: sphere_lights, on: [frame], every: 5, "
        "nodes: '/Lights/SphereLight_*', color: [[0, 1], [0, 1], [0, 1]], "
        "temperature_k: {normal: {mean: 6500, std: 500}}, "
        "intensity: {normal: {mean: 35000, std: 5000}}, radius_m: [0.05, 0.5]}");
    lights.set("offset", anywhere());
    list.list.push_back(std::move(lights));
    if (keys_.shape_num > 0) {
      list.list.push_back(
          native("{type: random_colors, name: shape_distractor_colors, on: [frame], every: 15, "
                 "nodes: '/Distractors/Shapes/**', color: [[0, 1], [0, 1], [0, 1]]}"));
    }
    Value dome = native(
        "{type: dome_light, name: dome_background, on: [frame], every: 25, "
        "nodes: '/Lights/DomeLight_*', intensity: 1000}");
    dome.set("textures", texts({std::begin(kIndoorSkies), std::end(kIndoorSkies)}));
    list.list.push_back(std::move(dome));
    if (has_distractors) {
      list.list.push_back(
          native("{type: random_velocities, name: drift, on: [frame], every: 17, "
                 "nodes: '/Distractors/*/floating_*', "
                 "velocity: [[-2.5, 2.5], [-2.5, 2.5], [-2.5, 2.5]], "
                 "angular_velocity_deg: [[-45, 45], [-45, 45], [-45, 45]]}"));
    }
    list.list.push_back(exposure());
    set("randomizers", std::move(list));
  }

  void add_renderer() {
    const Value& launch = section("launch_config");
    std::string mode = "RealTimePathTracing";
    if (launch.kind == Value::Kind::Map) {
      complain_about_unknown(launch, "launch_config", launch_keys());
      for (const auto& [key, value] : launch.map) {
        if (key == "renderer") {
          mode = value.scalar;
          check_mode(value);
        } else if (given_->find("launch_config")) {
          result_.without_effect.push_back("launch_config." + key +
                                           " (there is no window and no Kit application)");
        }
      }
    } else if (launch.kind != Value::Kind::Null) {
      diagnostics_.add(launch.place,
                       "launch_config: expected a mapping, found " + launch.describe());
    }
    const bool is_path_traced = mode == "PathTracing";
    // As with the other dialect's path_tracing.
    constexpr int kSamplesPerPathTracedSubframe = 3;
    Value renderer = native("{type: embree}");
    renderer.set("mode", Value::text(is_path_traced ? "path_traced" : "real_time"));
    renderer.set("samples", Value::integer(std::max(1, keys_.rt_subframes) *
                                           (is_path_traced ? kSamplesPerPathTracedSubframe : 1)));
    set("renderer", std::move(renderer));
  }

  void check_mode(const Value& value) {
    static const std::vector<std::string> modes{"RealTimePathTracing", "RaytracedLighting",
                                                "RayTracedLighting", "PathTracing"};
    if (std::find(modes.begin(), modes.end(), value.scalar) != modes.end()) return;
    const std::string near = nearest_name(value.scalar, modes);
    diagnostics_.add(value.place,
                     "launch_config.renderer: expected RealTimePathTracing, RaytracedLighting or "
                     "PathTracing, found " +
                         value.describe() + (near.empty() ? "" : "; did you mean '" + near + "'?"));
  }

  static Value simulation(int steps) {
    Value step = native("{each_step: bounce}");
    step.set("simulate", Value::integer(steps));
    return step;
  }

  void add_timeline() {
    const auto steps_of = [](double seconds) {
      return std::max(1, int(std::ceil(seconds * kStepsPerSecond - 1e-6)));
    };
    Value steps = native("[{event: cameras, every: 3}]");
    if (keys_.camera_collider_radius > 0.0) {
      Value push = simulation(4);
      push.set("camera_radius_m", Value::number(keys_.camera_collider_radius));
      push.set("every", Value::integer(3));
      steps.list.push_back(std::move(push));
    }
    steps.list.push_back(native("{capture: frame}"));
    Value shutter = simulation(steps_of(kExposureS));
    shutter.set("every", Value::integer(kFramesPerExposure));
    steps.list.push_back(std::move(shutter));
    steps.list.push_back(simulation(steps_of(keys_.simulation_duration)));
    Value repetition = Value::make_map();
    repetition.set("repeat", Value::integer(keys_.num_frames));
    repetition.set("steps", std::move(steps));
    Value timeline = Value::make_list();
    timeline.place = section("num_frames").place;
    timeline.list.push_back(simulation(1));
    timeline.list.push_back(std::move(repetition));
    set("timeline", std::move(timeline));
  }

  void add_writer() {
    Value list = Value::make_list();
    const Value& type = section("writer_type");
    if (type.kind == Value::Kind::Scalar) {
      list.list.push_back(
          writer_entry(type, &section("writer_kwargs"), type.place, "writer_kwargs"));
    } else if (type.kind != Value::Kind::Null) {
      diagnostics_.add(type.place, "writer_type: expected a name, found " + type.describe());
    }
    set_writers(std::move(list));
  }

  ObjectBasedKeys keys_;
  double near_m_ = 0.0;
};

}  // namespace

bool is_object_based_key(std::string_view key) {
  const std::vector<std::string>& keys = object_based_keys();
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

bool is_object_based_job(const Value& job) {
  return std::any_of(job.map.begin(), job.map.end(),
                     [](const auto& entry) { return is_object_based_key(entry.first); });
}

ReplicatorTranslation translate_object_based_job(const Value& job, Diagnostics& diagnostics) {
  return ObjectBasedTranslator(job, diagnostics).translate();
}

}  // namespace diorama
