// SPDX-License-Identifier: Apache-2.0
#include "framework/replicator/dialect.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>

#include "diorama/params.h"
#include "framework/replicator/object_based.h"
#include "framework/replicator/translator.h"

namespace diorama {
namespace {

using replicator::native;
using replicator::numbered;
using replicator::numbers;
using replicator::texts;

// Each struct holds a block of the file with the fallbacks that the reference's program uses when
// the block lacks a key.

struct EnvironmentsBlock {
  std::vector<std::string> folders;
  std::vector<std::string> files;
  void visit(ParamVisitor& v) {
    v.param("folders", folders, {"Folders of environments."});
    v.param("files", files, {"Single environments."});
  }
};

struct CaptureBlock {
  int total_captures = 0;
  int floating = 0;
  int dropped = 0;
  int num_cameras = 0;
  std::vector<double> resolution{1280, 720};
  bool disable_render_products = false;
  int rt_subframes = 3;
  bool path_tracing = false;
  double look_at_offset = 0.1;
  Range distance{0.5, 1.5};
  int num_scene_lights = 0;
  void visit(ParamVisitor& v) {
    v.param("total_captures", total_captures, {"Captures in all.", "", 0, 1e8});
    v.param("num_floating_captures_per_env", floating, {"Before the fall.", "", 0, 1e6});
    v.param("num_dropped_captures_per_env", dropped, {"After the fall.", "", 0, 1e6});
    v.param("num_cameras", num_cameras, {"Cameras.", "", 0, 1e4});
    v.param("resolution", resolution, {"Width and height.", "px", 1, 16384});
    v.param("disable_render_products", disable_render_products, {"No effect here."});
    v.param("rt_subframes", rt_subframes, {"Quality of a capture.", "", 1, 1e5});
    v.param("path_tracing", path_tracing, {"High quality."});
    v.param("camera_look_at_target_offset", look_at_offset,
            {"Jitter of the look-at point.", "m", 0});
    v.param("camera_distance_to_target_range", distance, {"Distance of the cameras.", "m", 0});
    v.param("num_scene_lights", num_scene_lights, {"Sphere lights.", "", 0, 1e4});
  }
};

struct AutoLabelBlock {
  int num = 0;
  double gravity_disabled_chance = 0.0;
  std::vector<std::string> folders;
  std::vector<std::string> files;
  std::string pattern;
  std::string replacement;
  void visit(ParamVisitor& v) {
    v.param("num", num, {"Objects.", "", 0, 1e5});
    v.param("gravity_disabled_chance", gravity_disabled_chance, {"Share that floats.", "", 0, 1});
    v.param("folders", folders, {"Folders of assets."});
    v.param("files", files, {"Single assets."});
    v.param("regex_replace_pattern", pattern, {"Part of the file's stem that is replaced."});
    v.param("regex_replace_repl", replacement, {"What it becomes."});
  }
};

struct ManualLabelBlock {
  std::string url;
  std::string label;
  int num = 0;
  double gravity_disabled_chance = 0.0;
  void visit(ParamVisitor& v) {
    v.param("url", url, {"The asset."});
    v.param("label", label, {"Its label."});
    v.param("num", num, {"Objects.", "", 0, 1e5});
    v.param("gravity_disabled_chance", gravity_disabled_chance, {"Share that floats.", "", 0, 1});
  }
};

struct ShapeBlock {
  int num = 0;
  double gravity_disabled_chance = 0.0;
  std::vector<std::string> types;
  std::vector<std::string> shape_types;
  void visit(ParamVisitor& v) {
    v.param("num", num, {"Objects.", "", 0, 1e5});
    v.param("gravity_disabled_chance", gravity_disabled_chance, {"Share that floats.", "", 0, 1});
    v.param("types", types, {"Shapes, as the reference's files call them."});
    v.param("shape_types", shape_types, {"Shapes, as the reference's program calls them."});
  }
};

struct MeshBlock {
  int num = 0;
  double gravity_disabled_chance = 0.0;
  std::vector<std::string> folders;
  std::vector<std::string> files;
  void visit(ParamVisitor& v) {
    v.param("num", num, {"Objects.", "", 0, 1e5});
    v.param("gravity_disabled_chance", gravity_disabled_chance, {"Share that floats.", "", 0, 1});
    v.param("folders", folders, {"Folders of assets."});
    v.param("files", files, {"Single assets."});
  }
};

struct PhysicsBlock {
  std::map<std::string, std::uint64_t> sizes;
  void visit(ParamVisitor& v) {
    for (const char* key :
         {"gpu_collision_stack_size", "gpu_found_lost_pairs_capacity",
          "gpu_found_lost_aggregate_pairs_capacity", "gpu_total_aggregate_pairs_capacity",
          "gpu_max_rigid_contact_count", "gpu_max_rigid_patch_count", "gpu_heap_capacity",
          "gpu_temp_buffer_capacity"}) {
      v.param(key, sizes[key], {"Size of a PhysX buffer."});
    }
  }
};

const std::vector<std::string> kSections{"environments", "capture", "writers",   "labeled_assets",
                                         "distractors",  "physics", "debug_mode"};

/// The reference's sky list, by path below the assets root.
constexpr const char* kSkies[] = {"/NVIDIA/Assets/Skies/Cloudy/champagne_castle_1_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Cloudy/kloofendal_48d_partly_cloudy_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Clear/evening_road_01_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Clear/mealie_road_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Clear/qwantani_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Clear/noon_grass_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Evening/evening_road_01_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Night/kloppenheim_02_4k.hdr",
                                  "/NVIDIA/Assets/Skies/Night/moonlit_golf_4k.hdr"};

constexpr std::int64_t kReferenceSeed = 12;

/// "\1" of Python becomes "$1", "\g<name>" "${name}"; a '$' stands for itself there.
std::string ecmascript_replacement(const std::string& python) {
  std::string text;
  for (std::size_t i = 0; i < python.size(); ++i) {
    const char c = python[i];
    if (c == '$') {
      text += "$$";
    } else if (c == '\\' && i + 1 < python.size() && python[i + 1] >= '0' && python[i + 1] <= '9') {
      text += std::string("$") + python[++i];
    } else if (c == '\\' && python.compare(i + 1, 2, "g<") == 0 &&
               python.find('>', i) != std::string::npos) {
      const std::size_t end = python.find('>', i);
      text += "${" + python.substr(i + 3, end - i - 3) + "}";
      i = end;
    } else {
      text += c;
    }
  }
  return text;
}

class InfinigenTranslator : private replicator::Translator {
 public:
  InfinigenTranslator(const Value& job, Diagnostics& diagnostics)
      : Translator(job, builtin_replicator_job(), "infinigen_default.yaml", diagnostics) {}

  ReplicatorTranslation translate() {
    complain_about_unknown_sections();
    const CaptureBlock capture = block<CaptureBlock>(section("capture"), "capture");
    const Value* resolution = section("capture").find("resolution");
    check_resolution(capture.resolution, resolution ? resolution->place : section("capture").place,
                     "capture.resolution");
    set("seed", Value::integer(kReferenceSeed));
    set("debug", section("debug_mode"));
    set("total_captures", Value::integer(capture.total_captures));
    add_environments();
    add_objects();
    add_lights(capture);
    add_cameras(capture);
    add_randomizers(capture);
    add_physics();
    add_renderer(capture);
    add_timeline(capture);
    add_writers();
    if (section("capture").find("disable_render_products")) {
      result_.without_effect.push_back(
          "capture.disable_render_products (nothing is rendered between captures in any case)");
    }
    return std::move(result_);
  }

 private:
  /// A mapping, or a list of mappings.
  std::vector<std::pair<std::string, const Value*>> items(const Value* value,
                                                          const std::string& path) {
    std::vector<std::pair<std::string, const Value*>> result;
    if (!value || value->kind == Value::Kind::Null) return result;
    if (value->kind != Value::Kind::List) return {{path, value}};
    for (std::size_t i = 0; i < value->list.size(); ++i) {
      result.emplace_back(path + "[" + std::to_string(i) + "]", &value->list[i]);
    }
    return result;
  }

  /// Sub-blocks of a section, which may hold nothing else.
  const Value* sub_block(const char* section_name, const char* key,
                         std::initializer_list<const char*> known) {
    const Value& map = section(section_name);
    if (map.kind == Value::Kind::Null) return nullptr;
    if (map.kind != Value::Kind::Map) {
      if (key == *known.begin()) {
        diagnostics_.add(
            map.place, std::string(section_name) + ": expected a mapping, found " + map.describe());
      }
      return nullptr;
    }
    if (key == *known.begin())
      complain_about_unknown(map, section_name, {known.begin(), known.end()});
    return map.find(key);
  }

  void complain_about_unknown_sections() { complain_about_unknown(*given_, "", kSections); }

  void add_environments() {
    const auto keys = block<EnvironmentsBlock>(section("environments"), "environments");
    Value list = Value::make_list();
    list.place = section("environments").place;
    if (!keys.folders.empty() || !keys.files.empty()) {
      Value entry = native("{type: files, name: environments}");
      entry.place = list.place;
      entry.set("folders", texts(keys.folders));
      entry.set("files", texts(keys.files));
      entry.set("skip", texts({".thumbs"}));
      list.list.push_back(std::move(entry));
    }
    set("environments", std::move(list));
    // The reference hides every node of that ending, glass table tops with all that stands on them
    // included, to let the light of ceiling lamps out. It looks for a dining table, and goes on
    // without one.
    set("environment", native("{hide: ['CeilingLight*001_SPLIT_GLA', 'Lamp*001_SPLIT_GLA'], "
                              "hide_in_debug: [_exterior, _ceiling], "
                              "colliders: triangle_mesh, box_colliders: [TableDining], "
                              "working_area: TableDining, unmatched: warning}"));
  }

  void add_auto_labelled(Value& objects) {
    int number = 0;
    for (const auto& [path, map] :
         items(sub_block("labeled_assets", "auto_label", {"auto_label", "manual_label"}),
               "labeled_assets.auto_label")) {
      const auto keys = block<AutoLabelBlock>(*map, path);
      Value entry = object_entry(*map, "files", "auto_label" + numbered(number++), "/Assets",
                                 keys.num, keys.gravity_disabled_chance);
      entry.set("label_pattern", Value::text(keys.pattern));
      entry.set("label_replacement", Value::text(ecmascript_replacement(keys.replacement)));
      entry.set("folders", texts(keys.folders));
      entry.set("files", texts(keys.files));
      objects.list.push_back(std::move(entry));
    }
  }

  void add_manually_labelled(Value& objects) {
    int number = 0;
    for (const auto& [path, map] :
         items(sub_block("labeled_assets", "manual_label", {"auto_label", "manual_label"}),
               "labeled_assets.manual_label")) {
      const auto keys = block<ManualLabelBlock>(*map, path);
      if (keys.url.empty() && map->kind == Value::Kind::Map) {
        diagnostics_.add(map->place, path + ": 'url' is missing");
      }
      Value entry = object_entry(*map, "files", "manual_label" + numbered(number++), "/Assets",
                                 keys.num, keys.gravity_disabled_chance);
      entry.set("label", Value::text(keys.label));
      entry.set("files", texts({keys.url}));
      objects.list.push_back(std::move(entry));
    }
  }

  void add_shapes(Value& objects) {
    const Value* map =
        sub_block("distractors", "shape_distractors", {"shape_distractors", "mesh_distractors"});
    if (!map) return;
    const auto keys = block<ShapeBlock>(*map, "distractors.shape_distractors");
    Value entry = object_entry(*map, "shapes", "shape_distractors", "/Distractors/Shapes", keys.num,
                               keys.gravity_disabled_chance);
    // The program's own word wins over the one that it never reads.
    const auto& shapes = keys.shape_types.empty() ? keys.types : keys.shape_types;
    if (!shapes.empty()) entry.set("shapes", texts(shapes));
    objects.list.push_back(std::move(entry));
  }

  void add_meshes(Value& objects) {
    const Value* map =
        sub_block("distractors", "mesh_distractors", {"shape_distractors", "mesh_distractors"});
    if (!map) return;
    const auto keys = block<MeshBlock>(*map, "distractors.mesh_distractors");
    Value entry = object_entry(*map, "files", "mesh_distractors", "/Distractors/Meshes", keys.num,
                               keys.gravity_disabled_chance);
    entry.set("folders", texts(keys.folders));
    entry.set("files", texts(keys.files));
    objects.list.push_back(std::move(entry));
  }

  void add_objects() {
    Value objects = Value::make_list();
    add_auto_labelled(objects);
    add_manually_labelled(objects);
    add_shapes(objects);
    add_meshes(objects);
    set("objects", std::move(objects));
  }

  void add_lights(const CaptureBlock& capture) {
    Value lights = native(
        "[{type: sphere, name: SphereLight_scene, radius_m: 0.5, visible_to_camera: false}, "
        "{type: dome, name: DomeLight}]");
    lights.list[0].set("count", Value::integer(capture.num_scene_lights));
    set("lights", std::move(lights));
  }

  void add_cameras(const CaptureBlock& capture) {
    Value cameras = native(
        "[{type: pinhole, name: cam, focal_length_mm: 24, horizontal_aperture_mm: 20.955, "
        "near_m: 0.25, far_m: 1000}]");
    cameras.place = section("capture").place;
    Value& camera = cameras.list.front();
    camera.place = cameras.place;
    camera.set("count", Value::integer(capture.num_cameras));
    if (capture.resolution.size() == 2) {
      camera.set("width", Value::integer(std::int64_t(capture.resolution[0])));
      camera.set("height", Value::integer(std::int64_t(capture.resolution[1])));
    }
    set("cameras", std::move(cameras));
  }

  bool has_objects_below(const std::string& pattern) {
    const std::vector<Value>& groups = result_.job.find("objects")->list;
    return std::any_of(groups.begin(), groups.end(), [&](const Value& group) {
      return pattern.starts_with(group.find("under")->scalar + "/");
    });
  }

  void add_randomizers(const CaptureBlock& capture) {
    Value list = native(R"([
      {type: scatter_poses, name: target_poses, on: [environment], nodes: "/Assets/*",
       offset: [[-0.5, 0.5], [-0.5, 0.5], [1.0, 1.5]], scale: [0.95, 1.15]},
      {type: scatter_poses, name: mesh_distractor_poses, on: [environment],
       nodes: "/Distractors/Meshes/*",
       offset: [[-1.0, 1.0], [-1.0, 1.0], [1.0, 2.0]], scale: [0.3, 1.0]},
      {type: scatter_poses, name: shape_distractor_poses, on: [environment],
       nodes: "/Distractors/Shapes/*",
       offset: [[-1.5, 1.5], [-1.5, 1.5], [1.0, 2.0]], scale: [0.01, 0.1]},
      {type: scatter_lights, name: scene_lights, on: [environment],
       nodes: "/Lights/SphereLight_scene_*",
       offset: [[-2.0, 2.0], [-2.0, 2.0], [1.0, 3.0]], intensity: [500, 2500],
       color: [[0.1, 0.9], [0.1, 0.9], [0.1, 0.9]]},
      {type: dome_light, name: dome_light, on: [environment], nodes: "/Lights/DomeLight_*",
       intensity: 1000},
      {type: random_colors, name: shape_distractor_colors, on: [environment],
       nodes: "/Distractors/Shapes/**"},
      {type: orbit_cameras, name: floating_cameras, on: [floating], nodes: "/Cameras/*",
       targets: "/Assets/*", polar_angle_deg: [0, 75]},
      {type: orbit_cameras, name: dropped_cameras, on: [dropped], nodes: "/Cameras/*",
       targets: "/Assets/*", polar_angle_deg: [0, 45]}])");
    for (Value& entry : list.list) {
      const std::string& type = entry.find("type")->scalar;
      if (type == "dome_light")
        entry.set("textures", texts({std::begin(kSkies), std::end(kSkies)}));
      if (type != "orbit_cameras") continue;
      entry.set("distance", numbers({capture.distance.lo, capture.distance.hi}));
      entry.set("look_at_offset", numbers({-capture.look_at_offset, capture.look_at_offset}));
    }
    // Of distractors that the file does not have there is nothing to randomize.
    std::erase_if(list.list, [&](const Value& entry) {
      const std::string& nodes = entry.find("nodes")->scalar;
      return nodes.starts_with("/Distractors/") && !has_objects_below(nodes);
    });
    set("randomizers", std::move(list));
  }

  void add_physics() {
    const Value& map = section("physics");
    block<PhysicsBlock>(map, "physics");
    for (const auto& [key, value] : map.map) {
      result_.without_effect.push_back("physics." + key + " (size of a PhysX buffer on the GPU)");
    }
    set("physics", native("{type: bullet}"));
  }

  void add_renderer(const CaptureBlock& capture) {
    Value renderer = native("{type: embree}");
    renderer.set("mode", Value::text(capture.path_tracing ? "path_traced" : "real_time"));
    // A subframe of the reference's path tracer is several samples of ours, as many as let its
    // multi-writer job end within a quarter of an hour on two cores; one of the real-time mode is
    // one.
    constexpr int kSamplesPerPathTracedSubframe = 3;
    renderer.set("samples",
                 Value::integer(capture.rt_subframes *
                                (capture.path_tracing ? kSamplesPerPathTracedSubframe : 1)));
    set("renderer", std::move(renderer));
  }

  void add_timeline(const CaptureBlock& capture) {
    Value list = native(
        "[{simulate: 4}, {capture: floating}, "
        "{simulate: {until: rest, at_least: 200, at_most: 800}}, {capture: dropped}]");
    list.place = section("capture").place;
    list.list[1].set("count", Value::integer(capture.floating));
    list.list[3].set("count", Value::integer(capture.dropped));
    set("timeline", std::move(list));
  }

  void add_writers() {
    Value list = Value::make_list();
    const Value& given = section("writers");
    list.place = given.place;
    for (const auto& [path, map] : items(&given, "writers")) {
      if (auto entry = writer(*map, path)) list.list.push_back(std::move(*entry));
    }
    set_writers(std::move(list));
  }

  std::optional<Value> writer(const Value& map, const std::string& path) {
    if (map.kind != Value::Kind::Map) {
      diagnostics_.add(map.place, path + ": expected a mapping, found " + map.describe());
      return std::nullopt;
    }
    complain_about_unknown(map, path, {"type", "kwargs"});
    const Value* type = map.find("type");
    if (!type || type->kind != Value::Kind::Scalar) {
      diagnostics_.add(map.place, path + ": 'type' is missing");
      return std::nullopt;
    }
    return writer_entry(*type, map.find("kwargs"), map.place, path + ".kwargs");
  }
};

bool has_kwargs(const Value* writers) {
  return writers && std::any_of(writers->list.begin(), writers->list.end(),
                                [](const Value& writer) { return writer.find("kwargs"); });
}

bool has_gpu_key(const Value* physics) {
  return physics && std::any_of(physics->map.begin(), physics->map.end(),
                                [](const auto& entry) { return entry.first.starts_with("gpu_"); });
}

}  // namespace

bool is_replicator_job(const Value& job) {
  if (is_object_based_job(job)) return true;
  for (const char* key : {"capture", "labeled_assets", "distractors", "debug_mode"}) {
    if (job.find(key)) return true;
  }
  const Value* environments = job.find("environments");
  if (environments && environments->kind == Value::Kind::Map) return true;
  return has_kwargs(job.find("writers")) || has_gpu_key(job.find("physics"));
}

bool is_replicator_section(std::string_view key) {
  return key == "capture" || key == "labeled_assets" || key == "distractors" ||
         key == "debug_mode" || is_object_based_key(key);
}

ReplicatorTranslation translate_replicator_job(const Value& job, Diagnostics& diagnostics) {
  if (is_object_based_job(job)) return translate_object_based_job(job, diagnostics);
  return InfinigenTranslator(job, diagnostics).translate();
}

}  // namespace diorama
