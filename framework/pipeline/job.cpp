// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/job.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "framework/config/clean_text.h"
#include "framework/config/joined.h"
#include "framework/config/place_of.h"
#include "framework/config/value_text.h"
#include "framework/pipeline/camera_rig.h"
#include "framework/pipeline/job_keys.h"
#include "framework/pipeline/job_sections.h"
#include "framework/pipeline/label_pattern.h"

namespace diorama {
namespace {

using detail::EngineHead;
using detail::EntryHead;
using detail::JobHead;
using detail::RecordKeys;
using detail::RestKeys;
using detail::StepKeys;
using detail::StepsKeys;

constexpr const char* kColliderWords[] = {"none", "triangle_mesh", "convex_hull", "bounding_box",
                                          "bounding_sphere"};
constexpr const char* kJointWords[] = {"held", "free"};
constexpr const char* kEnvironmentColliderWords[] = {"none", "triangle_mesh", "convex_hull",
                                                     "bounding_box"};
constexpr const char* kUnmatchedWords[] = {"error", "warning"};
constexpr const char* kPickWords[] = {"per_job", "per_visit"};
constexpr const char* kSettlePolicies[] = {"keep", "respawn", "drop"};
constexpr const char* kLightWords[] = {"sphere", "rect", "disk", "distant", "dome"};
constexpr const char* kCameraWords[] = {"pinhole", "opencv_pinhole", "fisheye_polynomial"};

std::string item_path(std::string_view section, std::size_t index) {
  return std::string(section) + "[" + std::to_string(index) + "]";
}

/// `type: null` is what people write for the null renderer; YAML reads it as nothing.
Value with_type_as_text(const Value& map) {
  Value copy = map;
  if (Value* type = copy.find("type"); type && type->kind == Value::Kind::Null) {
    const SourceLocation place = type->place;
    const SourceLocation key_place = type->key_place;
    *type = Value::text("null");
    type->place = place;
    type->key_place = key_place;
  }
  return copy;
}

template <class Keys>
void read_keys(const Value& map, const std::string& path, Keys& keys, Diagnostics& diagnostics) {
  ParamReader reader(map, path, diagnostics);
  keys.visit(reader);
}

template <class Keys>
void read_all_keys(const Value& map, const std::string& path, Keys& keys,
                   Diagnostics& diagnostics) {
  ParamReader reader(map, path, diagnostics);
  keys.visit(reader);
  reader.finish();
}

/// The maps of a list section; complains about other things and leaves them out.
std::vector<std::pair<std::string, Value>> entries(const Value* list, std::string_view section,
                                                   Diagnostics& diagnostics) {
  std::vector<std::pair<std::string, Value>> result;
  if (!list || list->kind == Value::Kind::Null) return result;
  if (list->kind != Value::Kind::List) {
    diagnostics.add(list->place, std::string(section) + ": expected a list of mappings, found " +
                                     list->describe());
    return result;
  }
  for (std::size_t i = 0; i < list->list.size(); ++i) {
    const Value& item = list->list[i];
    const std::string path = item_path(section, i);
    if (item.kind == Value::Kind::Map) {
      result.emplace_back(path, with_type_as_text(item));
    } else {
      diagnostics.add(item.place, path + ": expected a mapping, found " + item.describe());
    }
  }
  return result;
}

std::vector<std::pair<std::string, Value>> entries(const Value& job, std::string_view section,
                                                   Diagnostics& diagnostics) {
  return entries(job.find(section), section, diagnostics);
}

void require_type(const ComponentConfig& entry, Diagnostics& diagnostics) {
  if (entry.type.empty() && !entry.map.find("type")) {
    diagnostics.add(entry.map.place, entry.path + ": 'type' is missing");
  }
}

/// Names key random streams, node paths and folders, so they must differ.
template <class Entry, class NameOf, class MapOf>
void require_unique(const std::vector<Entry>& list, std::string_view section, NameOf name_of,
                    MapOf map_of, Diagnostics& diagnostics) {
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string& name = name_of(list[i]);
    if (name.empty() || seen.insert(name).second) continue;
    diagnostics.add(place_of(map_of(list[i]), "name"), item_path(section, i) +
                                                           ": another entry is called '" + name +
                                                           "'; give this one a 'name' of its own");
  }
}

// Files are called after nodes and writers, with more before and behind it; file systems take 255.
constexpr std::size_t kMostNameBytes = 200;

void check_node_name(const std::string& name, const Value& map, const std::string& path,
                     Diagnostics& diagnostics) {
  if (name.size() > kMostNameBytes) {
    diagnostics.add(place_of(map, "name"), path + ".name: expected a name of up to " +
                                               std::to_string(kMostNameBytes) + " bytes, found " +
                                               std::to_string(name.size()));
    return;
  }
  if (name.find('/') == std::string::npos && is_clean_name(name)) return;
  diagnostics.add(place_of(map, "name"),
                  path + ".name: expected a name without '/' and control characters, found '" +
                      clean_name(name) + "'");
}

template <class Group>
void name_after_type(Group& group) {
  if (group.name.empty()) group.name = group.type;
}

ComponentConfig read_entry(const std::string& path, Value map, Diagnostics& diagnostics) {
  EntryHead head;
  read_keys(map, path, head, diagnostics);
  if (head.name.empty()) head.name = head.type;
  ComponentConfig entry{head.type, head.name, std::move(map), path};
  require_type(entry, diagnostics);
  return entry;
}

/// The entries of a list that sets the parameters of components, each type once.
std::vector<ComponentConfig> read_parameters(const Value& value, std::string_view section,
                                             const std::string& why_once,
                                             Diagnostics& diagnostics) {
  std::vector<ComponentConfig> list;
  for (auto& [path, map] : entries(value, section, diagnostics)) {
    ComponentConfig entry = read_entry(path, std::move(map), diagnostics);
    const auto is_same = [&](const ComponentConfig& known) { return known.type == entry.type; };
    if (std::any_of(list.begin(), list.end(), is_same)) {
      diagnostics.add(place_of(entry.map, "type"),
                      path + ": another entry is of type '" + entry.type + "'; " + why_once);
    }
    list.push_back(std::move(entry));
  }
  return list;
}

void read_environments(const Value& value, Job& job, Diagnostics& diagnostics) {
  const std::size_t before = diagnostics.messages().size();
  for (auto& [path, map] : entries(value, "environments", diagnostics)) {
    job.environments.push_back(read_entry(path, std::move(map), diagnostics));
  }
  const Value* list = value.find("environments");
  if (job.environments.empty() && diagnostics.messages().size() == before) {
    diagnostics.add(list ? list->place : value.place,
                    "environments: the list is empty; name at least one, for example "
                    "'- {type: files, folders: [...]}'");
  }
}

void check_pattern(const ObjectGroup& group, const Value& map, const std::string& path,
                   Diagnostics& diagnostics) {
  if (!group.label_pattern) return;
  try {
    const LabelPattern pattern(*group.label_pattern);
  } catch (const Error& error) {
    diagnostics.add(place_of(map, "label_pattern"), path + ".label_pattern: " + error.what());
  }
}

void read_variants(ObjectGroup& group, const std::string& path, Diagnostics& diagnostics) {
  const Value& given = group.variants;
  if (given.kind == Value::Kind::Null) return;
  const std::string key = path + ".variants";
  if (given.kind != Value::Kind::Map) {
    diagnostics.add(
        given.place,
        key + ": expected variants by set, {lookVariant: [red, blue]}, found " + given.describe());
    return;
  }
  for (const auto& [set, value] : given.map) {
    std::vector<std::string> names;
    const std::vector<Value> one{value};
    for (const Value& item : value.kind == Value::Kind::List ? value.list : one) {
      const bool is_name = item.kind == Value::Kind::Scalar && !item.scalar.empty() &&
                           item.scalar.find_first_of("{}=/") == std::string::npos;
      if (is_name) {
        names.push_back(item.scalar);
      } else {
        diagnostics.add(item.place, key + "." + set + ": expected the name of a variant, found " +
                                        item.describe());
      }
    }
    if (names.empty() && value.kind == Value::Kind::List) {
      diagnostics.add(value.place, key + "." + set + ": the list is empty");
    }
    group.variant_sets.emplace_back(set, std::move(names));
  }
}

void read_parts(ObjectGroup& group, const std::string& path, Diagnostics& diagnostics) {
  const Value& given = group.parts;
  if (given.kind == Value::Kind::Null) return;
  const std::string key = path + ".parts";
  if (given.kind != Value::Kind::Map) {
    diagnostics.add(given.place, key + ": expected labels by name, {drawer_*: drawer}, found " +
                                     given.describe());
    return;
  }
  for (const auto& [pattern, label] : given.map) {
    const bool is_label = label.kind == Value::Kind::Scalar && !label.scalar.empty();
    if (!is_label) {
      diagnostics.add(label.place,
                      key + "." + pattern + ": expected a label, found " + label.describe());
    } else if (pattern.empty() || pattern.find('/') != std::string::npos) {
      diagnostics.add(
          label.place,
          key + ": expected names in which * stands for anything, found '" + pattern + "'");
    } else {
      group.part_labels.emplace_back(pattern, clean_name(label.scalar));
    }
  }
}

void check_fewer(const ObjectGroup& group, const Value& map, const std::string& path,
                 Diagnostics& diagnostics) {
  if (group.fewer > group.count) {
    diagnostics.add(place_of(map, "fewer"), path + ".fewer: expected at most the count, " +
                                                std::to_string(group.count) + ", found " +
                                                std::to_string(group.fewer));
  }
  if (group.fewer > 0 && group.pick != "per_visit") {
    diagnostics.add(place_of(map, "fewer"),
                    path + ".fewer: visits can differ only with 'pick: per_visit'");
  }
}

void read_objects(const Value& value, Job& job, Diagnostics& diagnostics) {
  for (auto& [path, map] : entries(value, "objects", diagnostics)) {
    ObjectGroup group;
    read_keys(map, path, group, diagnostics);
    name_after_type(group);
    check_pattern(group, map, path, diagnostics);
    read_variants(group, path, diagnostics);
    read_parts(group, path, diagnostics);
    check_node_name(group.name, map, path, diagnostics);
    if (group.under.size() < 2 || group.under.front() != '/' || group.under.back() == '/') {
      diagnostics.add(place_of(map, "under"),
                      path + ".under: expected a path like /Assets, found '" + group.under + "'");
    }
    check_fewer(group, map, path, diagnostics);
    group.loader = {group.type, group.name, std::move(map), path};
    require_type(group.loader, diagnostics);
    job.objects.push_back(std::move(group));
  }
  require_unique(
      job.objects, "objects", [](const ObjectGroup& g) -> const std::string& { return g.name; },
      [](const ObjectGroup& g) -> const Value& { return g.loader.map; }, diagnostics);
}

void read_lights(const Value& value, Job& job, Diagnostics& diagnostics) {
  std::set<std::string> names;
  for (auto& [path, map] : entries(value, "lights", diagnostics)) {
    LightGroup group;
    read_all_keys(map, path, group, diagnostics);
    name_after_type(group);
    check_node_name(group.name, map, path, diagnostics);
    if (!names.insert(group.name).second) {
      diagnostics.add(place_of(map, "name"), path + ": another light is called '" + group.name +
                                                 "'; give this one a 'name' of its own");
    }
    job.lights.push_back(std::move(group));
  }
}

void check_camera(const CameraGroup& group, const Value& map, const std::string& path,
                  Diagnostics& diagnostics) {
  if (group.far_m <= group.near_m) {
    diagnostics.add(place_of(map, "far_m"), path + ".far_m: must be greater than near_m");
  }
  if (group.distortion.size() > 8) {
    diagnostics.add(place_of(map, "distortion"),
                    path + ".distortion: expected at most 8 numbers (k1 k2 p1 p2 k3 k4 k5 k6)");
  }
  const std::size_t terms = group.fisheye_polynomial.size();
  if (terms > 6 || (group.type == "fisheye_polynomial" && terms < 2)) {
    diagnostics.add(place_of(map, "fisheye_polynomial"),
                    path + ".fisheye_polynomial: expected 2 to 6 numbers (theta = a + b r + ...)");
  }
  for (const auto& [key, focal] : {std::pair{"fx_px", group.fx_px}, {"fy_px", group.fy_px}}) {
    if (!focal || *focal > 0.0) continue;
    diagnostics.add(place_of(map, key), path + "." + key + ": must be greater than 0");
  }
}

void check_rig(const CameraGroup& group, const Value& map, const std::string& path,
               Diagnostics& diagnostics) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < group.rig.size(); ++i) {
    const RigMember& member = group.rig[i];
    const Value& item = map.find("rig")->list[i];
    const std::string item_path = path + ".rig[" + std::to_string(i) + "]";
    if (member.name.empty()) {
      diagnostics.add(item.place, item_path + ".name: is empty, expected one such as 'left'");
      continue;
    }
    check_node_name(member.name, item, item_path, diagnostics);
    if (!names.insert(member.name).second) {
      diagnostics.add(place_of(item, "name"),
                      item_path + ": another camera of the rig is called '" + member.name + "'");
    }
  }
}

void check_camera_names(const Value& value, const Job& job, Diagnostics& diagnostics) {
  std::set<std::string> names;
  for (const PlannedCamera& camera : planned_cameras(job.cameras)) {
    for (const std::string& name : {camera.rig, camera.name}) {
      if (name.empty() || (name == camera.rig && names.contains(name + "/"))) continue;
      if (!names.insert(name).second) {
        diagnostics.add(value.find("cameras")->place,
                        "cameras: two would be called '" + name + "'; give one another 'name'");
        return;
      }
      if (name == camera.rig) names.insert(name + "/");
    }
  }
}

void read_cameras(const Value& value, Job& job, Diagnostics& diagnostics) {
  std::set<std::string> names;
  for (auto& [path, map] : entries(value, "cameras", diagnostics)) {
    CameraGroup group;
    group.name = "cam";
    read_all_keys(map, path, group, diagnostics);
    check_node_name(group.name, map, path, diagnostics);
    check_camera(group, map, path, diagnostics);
    check_rig(group, map, path, diagnostics);
    if (!names.insert(group.name).second) {
      diagnostics.add(place_of(map, "name"), path + ": another camera is called '" + group.name +
                                                 "'; give this one a 'name' of its own");
    }
    job.cameras.push_back(std::move(group));
  }
  check_camera_names(value, job, diagnostics);
}

void check_moments(const RandomizerEntry& entry, const std::vector<std::string>& moments,
                   const Value& map, const std::string& path, Diagnostics& diagnostics) {
  if (entry.on.empty()) {
    diagnostics.add(
        place_of(map, "on"),
        path + ".on: no moment named, so it would never act; one of: " + joined(moments));
  }
  for (const std::string& moment : entry.on) {
    if (std::find(moments.begin(), moments.end(), moment) != moments.end()) continue;
    const std::string near = nearest_name(moment, moments);
    diagnostics.add(place_of(map, "on"),
                    path + ".on: unknown moment '" + moment + "'" +
                        (near.empty() ? "" : "; did you mean '" + near + "'?") +
                        " (known: " + joined(moments) + ")");
  }
}

/// A timeline with mistakes does not say which moments there are.
void read_randomizers(const Value& value, bool knows_moments, Job& job, Diagnostics& diagnostics) {
  std::vector<std::string> moments{"environment"};
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    const bool simulates = step.kind == TimelineStep::Kind::Simulate;
    const std::string& moment = simulates ? step.each_step : step.name;
    if (!moment.empty() && std::find(moments.begin(), moments.end(), moment) == moments.end()) {
      moments.push_back(moment);
    }
    return true;
  });
  for (auto& [path, map] : entries(value, "randomizers", diagnostics)) {
    RandomizerEntry entry;
    read_keys(map, path, entry, diagnostics);
    name_after_type(entry);
    if (knows_moments) check_moments(entry, moments, map, path, diagnostics);
    entry.component = {entry.type, entry.name, std::move(map), path};
    require_type(entry.component, diagnostics);
    job.randomizers.push_back(std::move(entry));
  }
  require_unique(
      job.randomizers, "randomizers",
      [](const RandomizerEntry& e) -> const std::string& { return e.name; },
      [](const RandomizerEntry& e) -> const Value& { return e.component.map; }, diagnostics);
}

void read_writers(const Value& value, Job& job, Diagnostics& diagnostics) {
  for (auto& [path, map] : entries(value, "writers", diagnostics)) {
    WriterEntry entry;
    read_keys(map, path, entry, diagnostics);
    name_after_type(entry);
    entry.component = {entry.type, entry.name, std::move(map), path};
    require_type(entry.component, diagnostics);
    job.writers.push_back(std::move(entry));
  }
  require_unique(
      job.writers, "writers", [](const WriterEntry& e) -> const std::string& { return e.name; },
      [](const WriterEntry& e) -> const Value& { return e.component.map; }, diagnostics);
}

/// What a clip shows is decided at its start, by its randomizers.
void check_no_clips(const ViewRule& rule, const Job& job, Diagnostics& diagnostics) {
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    if (step.kind != TimelineStep::Kind::Record || !rule.is_on(step.name)) return true;
    diagnostics.add(rule.map.place, rule.path + ": conditions hold for single captures, and '" +
                                        step.name + "' is recorded; name capture series in 'on'");
    return false;
  });
}

void read_views(const Value& value, Job& job, Diagnostics& diagnostics) {
  for (auto& [path, map] : entries(value, "views", diagnostics)) {
    ViewRule rule;
    read_all_keys(map, path, rule, diagnostics);
    if (rule.name.empty()) rule.name = "views_" + std::to_string(job.views.size());
    rule.map = std::move(map);
    rule.path = path;
    check_view_rule(rule, job.series(), diagnostics);
    check_no_clips(rule, job, diagnostics);
    job.views.push_back(std::move(rule));
  }
  require_unique(
      job.views, "views", [](const ViewRule& r) -> const std::string& { return r.name; },
      [](const ViewRule& r) -> const Value& { return r.map; }, diagnostics);
}

/// Where a folder of the job leads, seen from the output folder; nothing when that is out of it or
/// into the bookkeeping.
std::optional<std::filesystem::path> place_below_output(const Job& job, const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  fs::path root = fs::absolute(job.output.folder.empty() ? "." : job.output.folder, ignored);
  root = (root / "").lexically_normal();
  fs::path place = ((root / folder) / "").lexically_normal().lexically_relative(root);
  if (place.empty() || *place.begin() == "..") return std::nullopt;
  for (const fs::path& part : place) {
    if (part.string().starts_with(".diorama")) return std::nullopt;
  }
  return place;
}

/// What is wrong with a writer's folder that lies below the output folder; empty: nothing.
/// `writers` are the places of those before it.
std::string flaw_of_place(const std::filesystem::path& place,
                          const std::map<std::filesystem::path, std::string>& writers) {
  if (*place.begin() == "." || *place.begin() == "dataset.json") {
    return "the output folder's own files are there; name a folder below it";
  }
  for (const std::filesystem::path& part : place) {
    if (part.native().size() <= kMostNameBytes) continue;
    return "expected names of up to " + std::to_string(kMostNameBytes) + " bytes, found one of " +
           std::to_string(part.native().size());
  }
  const auto other = writers.find(place);
  if (other == writers.end()) return {};
  return "writer '" + other->second + "' has the same folder; give each its own";
}

/// A job of somebody else must not write where nobody expects it.
void check_folders(const Value& value, const Job& job, Diagnostics& diagnostics) {
  const std::string root = "the output folder '" + job.output.folder + "'";
  const std::string advice =
      "; name a folder below it, or choose one that holds both by '--output'";
  std::map<std::filesystem::path, std::string> places;
  for (const WriterEntry& writer : job.writers) {
    const char* key = writer.output_dir ? "output_dir" : "name";
    const std::string& folder = writer.output_dir ? *writer.output_dir : writer.name;
    const auto place = place_below_output(job, folder);
    const std::string flaw = place ? flaw_of_place(*place, places)
                                   : "the folder '" + folder + "' is not below " + root + advice;
    if (place) places.emplace(*place, writer.name);
    if (flaw.empty()) continue;
    diagnostics.add(place_of(writer.component.map, key),
                    writer.component.path + "." + key + ": " + flaw);
  }
  if (place_below_output(job, job.output.records)) return;
  const Value* output = value.find("output");
  diagnostics.add(
      output ? place_of(*output, "records") : value.place,
      "output.records: the folder '" + job.output.records + "' is not below " + root + advice);
}

ComponentConfig read_engine(const Value& value, std::string_view section, const char* default_type,
                            Diagnostics& diagnostics) {
  ComponentConfig entry{default_type, std::string(section), Value::make_map(),
                        std::string(section)};
  entry.map.set("type", Value::text(default_type));
  const Value* map = value.find(section);
  if (!map || map->kind == Value::Kind::Null) return entry;
  if (map->kind != Value::Kind::Map) {
    diagnostics.add(map->place,
                    std::string(section) + ": expected a mapping, found " + map->describe());
    return entry;
  }
  entry.map = with_type_as_text(*map);
  EngineHead head{default_type};
  read_keys(entry.map, entry.path, head, diagnostics);
  entry.type = head.type;
  entry.map.set("type", Value::text(head.type));
  return entry;
}

/// The number of `simulate: 200`, whatever stands beside it.
int read_steps(const Value& value, const std::string& path, Diagnostics& diagnostics) {
  Value alone = Value::make_map();
  alone.place = value.place;
  alone.set("simulate", value);
  StepsKeys keys;
  read_all_keys(alone, path, keys, diagnostics);
  if (keys.simulate != std::floor(keys.simulate)) {
    diagnostics.add(value.place, path + ".simulate: expected a whole number");
  }
  return int(keys.simulate);
}

/// `simulate: 200` or `simulate: {until: rest, ...}`.
std::optional<TimelineStep> read_simulation(const Value& map, const std::string& path,
                                            Diagnostics& diagnostics) {
  const std::size_t before = diagnostics.messages().size();
  const Value& value = *map.find("simulate");
  TimelineStep step;
  if (value.kind == Value::Kind::Map) {
    RestKeys keys;
    read_all_keys(value, path + ".simulate", keys, diagnostics);
    if (keys.at_least > keys.at_most) {
      diagnostics.add(place_of(value, "at_least"), path + ".simulate.at_least: expected at_most (" +
                                                       std::to_string(keys.at_most) +
                                                       ") or less, found " +
                                                       std::to_string(keys.at_least));
    }
    step.until_rest = true;
    step.steps = keys.at_most;
    step.at_least = keys.at_least;
  } else {
    step.steps = read_steps(value, path, diagnostics);
  }
  if (diagnostics.messages().size() != before) return std::nullopt;
  return step;
}

/// `record: {fps: 30, seconds: 2}`.
std::optional<TimelineStep> read_recording(const Value& map, const std::string& path,
                                           Diagnostics& diagnostics) {
  const std::size_t before = diagnostics.messages().size();
  const Value& value = *map.find("record");
  RecordKeys keys;
  if (value.kind != Value::Kind::Map) {
    diagnostics.add(value.place, path +
                                     ".record: expected a mapping such as {fps: 30, seconds: 2}, "
                                     "found " +
                                     value.describe());
    return std::nullopt;
  }
  read_all_keys(value, path + ".record", keys, diagnostics);
  if (diagnostics.messages().size() != before) return std::nullopt;
  // All frames that begin within the time: rates such as 29.97 fill no second.
  const double frames = keys.fps * keys.seconds;
  const double count = std::max(1.0, std::ceil(frames * (1.0 - 1e-6)));
  if (count > 1e6) {
    diagnostics.add(value.place,
                    path + ".record: expected fps x seconds to be at most 1000000 frames, found " +
                        std::to_string(std::llround(std::min(frames, 1e18))));
    return std::nullopt;
  }
  TimelineStep step{TimelineStep::Kind::Record, 0, keys.name, int(count)};
  step.fps = keys.fps;
  return step;
}

std::vector<TimelineStep> read_steps_of(const Value* list, const std::string& path, bool is_round,
                                        Diagnostics& diagnostics);

bool is_moment_name(const std::string& name) { return !name.empty() && name != "environment"; }

/// What stands beside a step must belong to it.
void check_companions(const StepKeys& keys, const Value& map, const std::string& path,
                      bool is_round, Diagnostics& diagnostics) {
  const auto complain = [&](const char* key, const std::string& where) {
    diagnostics.add(place_of(map, key), path + "." + key + ": has a meaning only " + where);
  };
  const bool simulates = keys.simulate.kind != Value::Kind::Null;
  if (map.find("each_step") && !simulates) complain("each_step", "beside 'simulate'");
  if (map.find("camera_radius_m") && !simulates) complain("camera_radius_m", "beside 'simulate'");
  if (map.find("steps") && !keys.repeat) complain("steps", "beside 'repeat'");
  if (keys.repeat && !map.find("steps")) {
    diagnostics.add(map.place, path + ": 'steps' is missing, the timeline that 'repeat' repeats");
  }
  if (map.find("every") && !is_round) complain("every", "within the 'steps' of a 'repeat'");
  if (keys.each_step && !is_moment_name(*keys.each_step)) {
    diagnostics.add(place_of(map, "each_step"), path +
                                                    ".each_step: a moment needs a name of its own, "
                                                    "found '" +
                                                    *keys.each_step + "'");
  }
}

TimelineStep read_repetition(const StepKeys& keys, const Value& map, const std::string& path,
                             Diagnostics& diagnostics) {
  TimelineStep step;
  step.kind = TimelineStep::Kind::Repeat;
  step.rounds = int(*keys.repeat);
  if (*keys.repeat != std::floor(*keys.repeat)) {
    diagnostics.add(place_of(map, "repeat"), path + ".repeat: expected a whole number");
  }
  step.steps_of_round = read_steps_of(map.find("steps"), path + ".steps", true, diagnostics);
  return step;
}

std::optional<TimelineStep> read_step(const Value& map, const std::string& path, bool is_round,
                                      Diagnostics& diagnostics) {
  StepKeys keys;
  const std::size_t before = diagnostics.messages().size();
  read_all_keys(map, path, keys, diagnostics);
  if (diagnostics.messages().size() != before) return std::nullopt;
  const bool simulates = keys.simulate.kind != Value::Kind::Null;
  const bool records = keys.record.kind != Value::Kind::Null;
  if (int(simulates) + int(records) + int(keys.capture.has_value()) + int(keys.event.has_value()) +
          int(keys.repeat.has_value()) !=
      1) {
    diagnostics.add(map.place, path +
                                   ": expected one of 'simulate: STEPS', 'capture: NAME' (with "
                                   "'count'), 'record: {fps: 30, seconds: 2}', 'event: NAME' and "
                                   "'repeat: TIMES' (with 'steps')");
    return std::nullopt;
  }
  check_companions(keys, map, path, is_round, diagnostics);
  std::optional<TimelineStep> step;
  if (simulates) {
    step = read_simulation(map, path, diagnostics);
  } else if (keys.repeat) {
    step = read_repetition(keys, map, path, diagnostics);
  } else if (records) {
    step = read_recording(map, path, diagnostics);
    if (step && !is_moment_name(step->name)) {
      diagnostics.add(map.place,
                      path + ": a moment needs a name of its own, found '" + step->name + "'");
    }
  } else {
    const std::string& name = keys.capture ? *keys.capture : *keys.event;
    if (!is_moment_name(name)) {
      diagnostics.add(map.place, path + ": a moment needs a name of its own, found '" + name + "'");
    }
    step = keys.capture ? TimelineStep{TimelineStep::Kind::Capture, 0, name, keys.count}
                        : TimelineStep{TimelineStep::Kind::Event, 0, name, 0};
  }
  if (diagnostics.messages().size() != before) return std::nullopt;
  step->every = keys.every;
  step->camera_radius_m = keys.camera_radius_m;
  step->each_step = keys.each_step.value_or("");
  return step;
}

std::vector<TimelineStep> read_steps_of(const Value* list, const std::string& path, bool is_round,
                                        Diagnostics& diagnostics) {
  std::vector<TimelineStep> steps;
  for (const auto& [item, map] : entries(list, path, diagnostics)) {
    if (auto step = read_step(map, item, is_round, diagnostics)) steps.push_back(std::move(*step));
  }
  return steps;
}

/// Rounds within rounds must not go on for ever.
std::int64_t steps_in_all(const std::vector<TimelineStep>& timeline) {
  constexpr std::int64_t kEnough = 1'000'000'000;
  std::int64_t count = 0;
  for (const TimelineStep& step : timeline) {
    // Rounds of nothing take their time as well.
    count += 1 + step.rounds * std::max<std::int64_t>(1, steps_in_all(step.steps_of_round));
    if (count >= kEnough) return kEnough;
  }
  return count;
}

/// What is called once per clip and what is called once per capture are moments of their own.
void check_clip_names(const Job& job, const SourceLocation& place, Diagnostics& diagnostics) {
  std::set<std::string> clips;
  std::set<std::string> others;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    const bool simulates = step.kind == TimelineStep::Kind::Simulate;
    const std::string& moment = simulates ? step.each_step : step.name;
    (step.kind == TimelineStep::Kind::Record ? clips : others).insert(moment);
    return true;
  });
  for (const std::string& name : clips) {
    if (!others.contains(name)) continue;
    diagnostics.add(place, "timeline: '" + name +
                               "' is the name of clips and of another moment; give 'record' a "
                               "'name' of its own");
    return;
  }
}

void read_timeline(const Value& value, Job& job, Diagnostics& diagnostics) {
  const Value* list = value.find("timeline");
  if (!list || list->kind == Value::Kind::Null) {
    job.timeline = default_timeline();
    return;
  }
  const std::size_t before = diagnostics.messages().size();
  job.timeline = read_steps_of(list, "timeline", false, diagnostics);
  constexpr std::int64_t kMostSteps = 10'000'000;
  if (steps_in_all(job.timeline) > kMostSteps) {
    diagnostics.add(list->place, "timeline: expected at most " + std::to_string(kMostSteps) +
                                     " steps per visit in all rounds; take fewer");
    job.timeline.clear();
  }
  check_clip_names(job, list->place, diagnostics);
  if (diagnostics.messages().size() != before) return;
  std::int64_t captures_per_visit = 0;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    captures_per_visit += step.count;
    return true;
  });
  if (captures_per_visit == 0 && job.total_captures > 0) {
    diagnostics.add(list->place,
                    "timeline: the capture series have no captures in all, so "
                    "total_captures: " +
                        std::to_string(job.total_captures) +
                        " can never be reached; give a series a 'count' above 0");
  }
}

template <class Section>
void read_section(const Value& job, const char* name, Section& section, Diagnostics& diagnostics) {
  const Value* map = job.find(name);
  if (!map || map->kind == Value::Kind::Null) return;
  if (map->kind != Value::Kind::Map) {
    diagnostics.add(map->place,
                    std::string(name) + ": expected a mapping, found " + map->describe());
    return;
  }
  read_all_keys(*map, name, section, diagnostics);
}

bool is_plain_key(std::string_view key) {
  const auto& specs = plain_job_keys();
  return std::ranges::any_of(specs, [&](const ParamSpec& spec) { return spec.key == key; });
}

void report_unknown_sections(const Value& job, Diagnostics& diagnostics) {
  std::vector<std::string> known;
  for (const ParamSpec& spec : job_specs()) known.push_back(spec.key);
  for (const auto& [key, value] : job.map) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const std::string near = nearest_name(key, known);
    diagnostics.add(value.key_place, "unknown key '" + key + "'" +
                                         (near.empty() ? "" : "; did you mean '" + near + "'?"));
  }
}

Value head_of(const Value& job) {
  Value head = Value::make_map();
  head.place = job.place;
  for (const auto& [key, value] : job.map) {
    if (is_plain_key(key)) head.map.emplace_back(key, value);
  }
  return head;
}

void check_asset_prefixes(const Value& value, const Job& job, Diagnostics& diagnostics) {
  for (std::size_t i = 0; i < job.asset_prefixes.size(); ++i) {
    if (!job.asset_prefixes[i].prefix.empty()) continue;
    diagnostics.add(value.find("asset_prefixes")->list[i].place,
                    item_path("asset_prefixes", i) +
                        ".prefix: is empty, expected how names begin: 'omniverse://nucleus/'");
  }
}

}  // namespace

void EnvironmentRules::visit(ParamVisitor& v) {
  v.param("hide", hide,
          {"Hides nodes whose path holds one of these texts, in which * stands for anything "
           "within a name."});
  v.param("hide_in_debug", hide_in_debug, {"The same, in debug mode only."});
  v.choice("colliders", colliders, kEnvironmentColliderWords,
           {"Collider of every mesh of the environment."});
  v.param(
      "box_colliders", box_colliders,
      {"The first node whose path holds the text gets bounding box colliders instead, for those "
       "of its meshes that fill their box: table tops, but no table that is one mesh."});
  v.param("working_area", working_area,
          {"The first node whose path holds this text is the centre of the working area; null: the "
           "origin."});
  v.param("walls", walls,
          {"Width, depth and height of a box round the working area, along x, y and z: invisible "
           "walls round it keep objects in. Empty: none.",
           "m", 0.01, 1e5});
  v.param("max_lamp_lux", max_lamp_lux,
          {"Lamps of the environment that light a surface 2 m away with more are dimmed to this; "
           "null: they stay as they are.",
           "lux", 1e-3, 1e12});
  v.choice("joints", joints, kJointWords,
           {"held: what joints hold together stands still as it is posed; free: it moves as its "
            "joints allow."});
  v.choice("unmatched", unmatched, kUnmatchedWords,
           {"What a text of these rules, or a pattern below /Environment, is that fits nothing in "
            "any of the job's environments. What fits in some of them only is never an error."});
}

void ObjectGroup::visit(ParamVisitor& v) {
  v.param("type", type, {"Loader whose assets are picked from."});
  v.param("name", name, {"Name of the group; keys its random choices. Default: the type."});
  v.param("under", under, {"Path of the parent node."});
  v.param("count", count, {"Objects, each picked at random from the loader's assets.", "", 0, 1e5});
  v.param("fewer", fewer,
          {"Each visit has 0 to this many objects less, every number as likely.", "", 0, 1e5});
  v.choice("pick", pick, kPickWords,
           {"per_job: every visit has the same objects; per_visit: each visit picks its own."});
  v.param("balance", balance,
          {"Every asset comes to use equally often: none twice before all were picked once. Else "
           "each pick is independent."});
  v.param("label", label, {"Label of every object of the group; null: none."});
  v.param(
      "label_pattern", label_pattern,
      {"Regular expression, without back references and look-around; the label is the file's stem "
       "with every match replaced."});
  v.param("label_replacement", label_replacement,
          {"What a match of label_pattern becomes; `$1` is its first group."});
  v.param("taxonomy", taxonomy, {"Taxonomy of the label."});
  v.param(
      "keypoints", keypoints,
      {"Names of keypoints, in their order, that labels tell of these objects: of those that the "
       "assets bring along, or of FILE.keypoints.yaml beside them."});
  v.param("variants", variants,
          {"Variants of the assets to choose from, by set: {lookVariant: [red, blue]}. Drawn for "
           "each object; null: what the asset itself selects."});
  v.param("gravity_disabled_chance", gravity_disabled_chance,
          {"Share of the objects that float.", "", 0, 1});
  v.choice("collider", collider, kColliderWords, {"Collider of every mesh of the object."});
  v.param("mass_kg", mass_kg, {"Mass where the asset says nothing.", "kg", 1e-6, 1e6});
  v.choice("joints", joints, kJointWords,
           {"held: an object moves as one, as its joints are posed; free: its parts move as its "
            "joints allow."});
  v.param("parts", parts,
          {"Labels of parts by the names of their nodes, in which * stands for anything: "
           "{drawer_*: drawer}. Parts are instances of their own; the first name that fits counts; "
           "null: the object is one."});
}

void LightGroup::visit(ParamVisitor& v) {
  v.choice("type", type, kLightWords, {"Kind of light."});
  v.param("name", name, {"Nodes are /Lights/NAME_0 and so on. Default: the type."});
  v.param("count", count, {"How many lights.", "", 0, 1e4});
  v.param("color", color, {"Linear red, green and blue.", "", 0});
  v.param(
      "intensity", intensity,
      {"Factor of the colour: luminance in nits, of a distant light illuminance in lux.", "", 0});
  v.param("radius_m", radius_m, {"Radius of sphere and disk.", "m", 0});
  v.param("width_m", width_m, {"Size of a rect along its x axis.", "m", 0});
  v.param("height_m", height_m, {"Size of a rect along its y axis.", "m", 0});
  v.param("angle_deg", angle_deg, {"Angular diameter of a distant light.", "deg", 0, 180});
  v.param("cone_angle_deg", cone_angle_deg,
          {"Half angle beyond which there is no light; 180: no cone.", "deg", 0, 180});
  v.param("cone_softness", cone_softness, {"Share of the cone over which it fades.", "", 0, 1});
  v.param("texture", texture, {"Equirectangular picture of a dome."});
  v.param("visible_to_camera", visible_to_camera, {"Whether cameras see the light itself."});
  v.param("position", position, {"World position.", "m"});
  v.param("rotation_deg", rotation_deg, {"Turns about x, then y, then z.", "deg"});
}

void RigMember::visit(ParamVisitor& v) {
  v.param("name", name, {"Its node is /Cameras/RIG_0/RIG_0_NAME and so on."});
  v.param("position", position,
          {"Place in the rig's space: x right, y up, z back, as a camera sees it.", "m"});
  v.param("rotation_deg", rotation_deg,
          {"Turn about the rig's x, then y, then z axis; none: it looks along -z.", "deg"});
  v.param(
      "count", count,
      {"So many, evenly round the rig's y axis, each turned with its place: a ring.", "", 1, 360});
  v.param("width", width_px, {"Image width; null: the entry's.", "px", 1, 16384});
  v.param("height", height_px, {"Image height; null: the entry's.", "px", 1, 16384});
  v.param("focal_length_mm", focal_length_mm, {"Focal length; null: the entry's.", "mm", 0.01});
  v.param("horizontal_aperture_mm", horizontal_aperture_mm,
          {"Width of the sensor; null: the entry's.", "mm", 0.01});
  v.param("fx_px", fx_px, {"Focal length in pixels along x; null: the entry's.", "px", 0});
  v.param("fy_px", fy_px, {"Focal length in pixels along y; null: the entry's.", "px", 0});
  v.param("cx_px", cx_px, {"Principal point from the left edge; null: the entry's.", "px"});
  v.param("cy_px", cy_px, {"Principal point from the upper edge; null: the entry's.", "px"});
}

void CameraGroup::visit(ParamVisitor& v) {
  v.choice("type", type, kCameraWords, {"Lens model."});
  v.param("name", name, {"Nodes are /Cameras/NAME_0 and so on. Default: cam."});
  v.param("count", count, {"How many cameras, or rigs.", "", 0, 1e4});
  v.param("width", width, {"Image width.", "px", 1, 16384});
  v.param("height", height, {"Image height.", "px", 1, 16384});
  v.param("focal_length_mm", focal_length_mm, {"Focal length.", "mm", 0.01});
  v.param("horizontal_aperture_mm", horizontal_aperture_mm, {"Width of the sensor.", "mm", 0.01});
  v.param("fx_px", fx_px, {"Focal length in pixels along x; null: from the lens.", "px", 0});
  v.param("fy_px", fy_px, {"Focal length in pixels along y; null: as fx_px.", "px", 0});
  v.param("cx_px", cx_px, {"Principal point from the left edge; null: the centre.", "px"});
  v.param("cy_px", cy_px, {"Principal point from the upper edge; null: the centre.", "px"});
  v.param("distortion", distortion, {"OpenCV's k1 k2 p1 p2 k3 k4 k5 k6."});
  v.param("fisheye_polynomial", fisheye_polynomial,
          {"Coefficients of theta = a + b r + c r^2 + ..., r in pixels."});
  v.param("fisheye_max_angle_deg", fisheye_max_angle_deg,
          {"Largest angle off the axis that is imaged.", "deg", 0, 180});
  v.param("near_m", near_m, {"Nothing nearer along the axis is seen.", "m", 1e-6});
  v.param("far_m", far_m, {"Nothing farther along the axis is seen.", "m", 0});
  v.param("f_stop", f_stop, {"Aperture; 0: everything is in focus.", "", 0});
  v.param("focus_distance_m", focus_distance_m, {"Distance of the plane in focus.", "m", 0});
  v.param("exposure_time_s", exposure_time_s,
          {"How long a row gathers light: what moves is blurred. 0: no blur.", "s", 0, 10});
  v.param("readout_time_s", readout_time_s,
          {"From the first row to the last of a rolling shutter; 0: all at once.", "s", 0, 10});
  v.param("position", position, {"World position until a randomizer moves it.", "m"});
  v.param("look_at", look_at, {"World point that it looks at.", "m"});
  v.list("rig", rig,
         {"Cameras that move as one: stereo pairs, colour and depth, rings. /Cameras/NAME_0 is the "
          "rig then, which randomizers place, and these are below it; without: one camera."});
}

void RandomizerEntry::visit(ParamVisitor& v) {
  v.param("type", type, {"Type of the component."});
  v.param("name", name, {"Keys its random numbers. Default: the type."});
  v.param("on", on, {"Moments at which it acts: environment, capture series, events."});
  v.param("every", every,
          {"Draws anew at every so many visits, captures or events only; what it did stays until "
           "then.",
           "", 1, 1e6});
}

void WriterEntry::visit(ParamVisitor& v) {
  v.param("type", type, {"Type of the component."});
  v.param("name", name, {"Name of the writer. Default: the type."});
  v.param("output_dir", output_dir, {"Its folder, below output.folder; null: the name."});
}

void SettleSection::visit(ParamVisitor& v) {
  v.choice("policy", policy, kSettlePolicies,
           {"What becomes of objects that are outside the room after a simulation, and of those "
            "that move, hang in the air or are stuck in something after one that goes on until "
            "rest. keep: they stay; respawn: the randomizers of the moment environment place them "
            "anew, and the simulation is repeated; drop: they are taken out of the visit. settle/ "
            "names them in any case."});
  v.param("max_respawns", max_respawns,
          {"Repeats per simulation at most; what has not settled then is taken out.", "", 1, 1000});
  v.param("rest_speed", rest_speed, {"Slower than this is at rest.", "m/s", 0, 1e3});
}

void OutputSection::visit(ParamVisitor& v) {
  v.param("folder", folder, {"Folder of the dataset; relative to the current one."});
  v.param("records", records,
          {"Folder of dataset.json and the journal of finished captures, below `folder`."});
}

std::vector<ComponentConfig> read_annotators(const Value& job, Diagnostics& diagnostics) {
  std::vector<ComponentConfig> list;
  for (auto& [path, map] : entries(job, "annotators", diagnostics)) {
    list.push_back(read_entry(path, std::move(map), diagnostics));
  }
  return list;
}

std::vector<std::string> Job::series() const {
  std::vector<std::string> names;
  for_each_step(timeline, [&](const TimelineStep& step) {
    const bool captures = step.kind == TimelineStep::Kind::Capture;
    if (captures && std::find(names.begin(), names.end(), step.name) == names.end()) {
      names.push_back(step.name);
    }
    return true;
  });
  return names;
}

std::vector<std::string> Job::camera_names() const {
  std::vector<std::string> names;
  for (const PlannedCamera& camera : planned_cameras(cameras)) names.push_back(camera.name);
  return names;
}

namespace {

/// False: the body wants no more.
bool go_through(const std::vector<TimelineStep>& timeline, int round,
                const std::function<bool(const TimelineStep&)>& body) {
  for (const TimelineStep& step : timeline) {
    if (round % step.every != 0) continue;
    if (step.kind != TimelineStep::Kind::Repeat) {
      if (!body(step)) return false;
      continue;
    }
    for (int i = 0; i < step.rounds; ++i) {
      if (!go_through(step.steps_of_round, i, body)) return false;
    }
  }
  return true;
}

}  // namespace

void for_each_step(const std::vector<TimelineStep>& timeline,
                   const std::function<bool(const TimelineStep&)>& body) {
  go_through(timeline, 0, body);
}

std::vector<TimelineStep> default_timeline() {
  using Kind = TimelineStep::Kind;
  return {{Kind::Simulate, 4, "", 0},
          {Kind::Capture, 0, "floating", 2},
          {Kind::Simulate, 800, "", 0, true, 200},
          {Kind::Capture, 0, "dropped", 2}};
}

Job read_job(const Value& value, Diagnostics& diagnostics) {
  Job job;
  if (value.kind != Value::Kind::Map) {
    diagnostics.add(value.place, "a job is a mapping of sections, found " + value.describe());
    return job;
  }
  report_unknown_sections(value, diagnostics);
  JobHead head;
  read_all_keys(head_of(value), "", head, diagnostics);
  job.seed = head.seed;
  job.assets_root = head.assets_root;
  job.asset_prefixes = head.asset_prefixes;
  check_asset_prefixes(value, job, diagnostics);
  job.debug = head.debug;
  job.total_captures = head.total_captures;
  job.loaders =
      read_parameters(value, "loaders", "each loader reads its files in one way", diagnostics);
  read_environments(value, job, diagnostics);
  read_section(value, "environment", job.environment, diagnostics);
  if (const Value* map = value.find("environment")) job.environment.map = *map;
  if (!job.environment.walls.empty() && job.environment.walls.size() != 3) {
    diagnostics.add(place_of(*value.find("environment"), "walls"),
                    "environment.walls: expected [width, depth, height] in metres, or []");
  }
  read_objects(value, job, diagnostics);
  read_lights(value, job, diagnostics);
  read_cameras(value, job, diagnostics);
  const std::size_t before = diagnostics.messages().size();
  read_timeline(value, job, diagnostics);
  const bool knows_moments = diagnostics.messages().size() == before;
  read_randomizers(value, knows_moments, job, diagnostics);
  job.physics = read_engine(value, "physics", kDefaultPhysics, diagnostics);
  job.renderer = read_engine(value, "renderer", kDefaultRenderer, diagnostics);
  job.annotators = read_annotators(value, diagnostics);
  read_section(value, "settle", job.settle, diagnostics);
  read_views(value, job, diagnostics);
  read_writers(value, job, diagnostics);
  read_section(value, "output", job.output, diagnostics);
  check_folders(value, job, diagnostics);
  if (job.camera_names().empty() && job.total_captures > 0) {
    const Value* cameras = value.find("cameras");
    diagnostics.add(cameras ? cameras->place : value.place,
                    "cameras: there are none, so a capture would hold no picture; add "
                    "'- {type: pinhole, count: 1}'");
  }
  return job;
}

std::string node_name(std::string_view text) {
  std::string name(text);
  std::replace(name.begin(), name.end(), '/', '_');
  return name.empty() ? "object" : name;
}

std::vector<std::string_view> host_keys(std::string_view section) {
  static const auto all = [] {
    std::map<std::string, std::vector<std::string>, std::less<>> keys;
    for (const JobSection& each : job_sections()) {
      for (const ParamSpec& spec : each.keys()) keys[each.key].push_back(spec.key);
    }
    return keys;
  }();
  const auto& keys = all.find(section)->second;
  return {keys.begin(), keys.end()};
}

}  // namespace diorama
