// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/component.h"
#include "diorama/config.h"
#include "diorama/params.h"
#include "framework/host/asset_paths.h"
#include "framework/pipeline/view_rules.h"

namespace diorama {

/// A native job file as data. Every section declares its keys once, in visit(), so that reading,
/// checking, printing and the JSON Schema agree. Entries that name a component keep their whole
/// mapping: the component reads its own keys from it later.

/// One entry that names a component.
struct ComponentConfig {
  std::string type;
  std::string name;  ///< Unique within its list; the type when the job says nothing.
  Value map;         ///< The whole entry.
  std::string path;  ///< For messages: "environments[0]".
};

/// Rules for what was loaded below /Environment. Texts are looked for in the part of a node's path
/// below the environment's own node; a '*' in them stands for anything but '/'.
struct EnvironmentRules {
  std::vector<std::string> hide;
  std::vector<std::string> hide_in_debug;
  std::string colliders = "triangle_mesh";
  std::vector<std::string> box_colliders;
  std::optional<std::string> working_area;
  std::optional<double> max_lamp_lux;  ///< At kLampDistance.
  std::string joints = "held";
  std::vector<double> walls;  ///< Size of the box that they enclose, or empty: none.
  std::string unmatched = "error";
  Value map;  ///< As the job gives it, for places in messages.
  void visit(ParamVisitor& v);
};

/// Objects of one kind, chosen once per job or per visit, and spawned in every visit.
struct ObjectGroup {
  ComponentConfig loader;
  std::string type;
  std::string name;
  std::string under = "/Assets";
  int count = 1;
  int fewer = 0;  ///< At most `count`.
  std::string pick = "per_job";
  bool balance = false;
  std::optional<std::string> label;
  std::optional<std::string> label_pattern;
  std::string label_replacement;
  std::string taxonomy = "class";
  std::vector<std::string> keypoints;
  Value variants;  ///< As given.
  /// Variant set and what is chosen from, in the job's order.
  std::vector<std::pair<std::string, std::vector<std::string>>> variant_sets;
  double gravity_disabled_chance = 0.0;
  std::string collider = "convex_hull";
  double mass_kg = 1.0;
  std::string joints = "held";
  Value parts;  ///< As given.
  /// Patterns of names and the labels of what has such a name, in the job's order.
  std::vector<std::pair<std::string, std::string>> part_labels;
  void visit(ParamVisitor& v);
};

struct LightGroup {
  std::string type = "sphere";
  std::string name;
  int count = 1;
  Vec3 color{1.0, 1.0, 1.0};
  double intensity = 1000.0;
  double radius_m = 0.1;
  double width_m = 1.0;
  double height_m = 1.0;
  double angle_deg = 0.53;
  double cone_angle_deg = 180.0;
  double cone_softness = 0.0;
  std::optional<std::string> texture;
  bool visible_to_camera = true;
  Vec3 position{0.0, 0.0, 0.0};
  Vec3 rotation_deg{0.0, 0.0, 0.0};
  void visit(ParamVisitor& v);
};

/// A camera (or a ring of them) at a fixed place of a rig.
struct RigMember {
  std::string name;
  Vec3 position{0.0, 0.0, 0.0};
  Vec3 rotation_deg{0.0, 0.0, 0.0};
  int count = 1;
  std::optional<double> width_px;
  std::optional<double> height_px;
  std::optional<double> focal_length_mm;
  std::optional<double> horizontal_aperture_mm;
  std::optional<double> fx_px;
  std::optional<double> fy_px;
  std::optional<double> cx_px;
  std::optional<double> cy_px;
  void visit(ParamVisitor& v);
};

struct CameraGroup {
  std::string type = "pinhole";
  std::string name;
  int count = 1;
  int width = 640;
  int height = 480;
  double focal_length_mm = 24.0;
  double horizontal_aperture_mm = 20.955;
  std::optional<double> fx_px;
  std::optional<double> fy_px;
  std::optional<double> cx_px;
  std::optional<double> cy_px;
  std::vector<double> distortion;
  std::vector<double> fisheye_polynomial;
  double fisheye_max_angle_deg = 180.0;
  double near_m = 0.25;
  double far_m = 1000.0;
  double f_stop = 0.0;
  double focus_distance_m = 0.0;
  double exposure_time_s = 0.0;
  double readout_time_s = 0.0;
  Vec3 position{0.0, 0.0, 0.0};
  Vec3 look_at{1.0, 0.0, 0.0};
  std::vector<RigMember> rig;  ///< Empty: the camera stands alone.
  void visit(ParamVisitor& v);
};

struct RandomizerEntry {
  ComponentConfig component;
  std::string type;
  std::string name;
  std::vector<std::string> on;  ///< "environment", capture series, events.
  int every = 1;                ///< See randomizer_call().
  void visit(ParamVisitor& v);
};

struct WriterEntry {
  ComponentConfig component;
  std::string type;
  std::string name;
  /// Not outside of OutputSection::folder; null: the name.
  std::optional<std::string> output_dir;
  void visit(ParamVisitor& v);
};

/// One step of a visit; exactly one of the kinds is meant.
struct TimelineStep {
  enum class Kind : std::uint8_t { Simulate, Capture, Event, Record, Repeat };
  Kind kind = Kind::Simulate;
  int steps = 0;     ///< Simulate; until rest: at most.
  std::string name;  ///< Capture, Record: the series. Event: the moment that randomizers name.
  int count = 0;     ///< Capture: captures of the series per visit. Record: frames.
  bool until_rest = false;  ///< Simulate: ends when everything is at rest.
  int at_least = 0;         ///< Simulate until rest: steps that are taken in any case.
  double fps = 0.0;         ///< Record: frames per second.
  /// Simulate: radius of spheres round the cameras that push objects away meanwhile; 0: none.
  double camera_radius_m = 0.0;
  std::string each_step = {};  ///< Simulate: moment after every step, for randomizers.
  int every = 1;               ///< In a repetition: taken in the first round and in every so many.
  int rounds = 0;              ///< Repeat.
  std::vector<TimelineStep> steps_of_round = {};  ///< Repeat.
};

/// Calls body(step) for each step but repetitions, as often and in the order as they happen, until
/// it returns false.
void for_each_step(const std::vector<TimelineStep>& timeline,
                   const std::function<bool(const TimelineStep&)>& body);

/// What becomes of objects that are outside the environment's box after a simulation, or not
/// settled after one that goes on until rest.
struct SettleSection {
  std::string policy = "respawn";
  int max_respawns = 3;
  double rest_speed = 0.05;
  void visit(ParamVisitor& v);
};

struct OutputSection {
  std::string folder = "_out_diorama";
  std::string records = ".";
  void visit(ParamVisitor& v);
};

struct Job {
  std::uint64_t seed = 0;
  std::optional<std::string> assets_root;
  std::vector<AssetPrefix> asset_prefixes;
  bool debug = false;
  int total_captures = 1;
  std::vector<ComponentConfig> loaders;  ///< Parameters of the loaders of files; types are unique.
  std::vector<ComponentConfig> environments;
  EnvironmentRules environment;
  std::vector<ObjectGroup> objects;
  std::vector<LightGroup> lights;
  std::vector<CameraGroup> cameras;
  std::vector<RandomizerEntry> randomizers;
  ComponentConfig physics;  ///< Type "none": nothing moves by itself.
  ComponentConfig renderer;
  std::vector<ComponentConfig>
      annotators;  ///< Come before the renderer's own channels; see Demand.
  std::vector<TimelineStep> timeline;
  SettleSection settle;
  std::vector<ViewRule> views;
  std::vector<WriterEntry> writers;
  OutputSection output;

  /// Names of the capture series in timeline order, each once; clips are none of them.
  std::vector<std::string> series() const;
  /// "cam_0", "stereo_0_left" ... in job order.
  std::vector<std::string> camera_names() const;
};

inline constexpr const char* kDefaultPhysics = "bullet";
inline constexpr const char* kDefaultRenderer = "embree";

/// What a visit does when the job says nothing: 4 steps that resolve overlaps, floating captures,
/// 200 steps or more to fall and come to rest, dropped captures.
std::vector<TimelineStep> default_timeline();

/// Reads a native job. All diagnostics are collected; the result is of use only when there are
/// none.
Job read_job(const Value& job, Diagnostics& diagnostics);

/// The section `annotators` of a job, which may consist of it alone.
std::vector<ComponentConfig> read_annotators(const Value& job, Diagnostics& diagnostics);

/// The name of a node, made from a file's name or a label: '/' becomes '_', never empty.
std::string node_name(std::string_view text);

/// The parameters of a component type; nothing for an unknown one.
using DescribeComponent =
    std::function<std::optional<std::vector<ParamSpec>>(ComponentKind kind, std::string_view type)>;

/// The job with every default written out, in the order of the reference: reading it again gives
/// the same job.
Value resolved_job(const Value& job, const DescribeComponent& describe);

/// Keys that the host reads from an entry of a section ("type", "name" ...); the rest belongs to
/// the component that it names.
std::vector<std::string_view> host_keys(std::string_view section);

/// The keys of a job file as data; lists of components have the host's keys as children.
std::vector<ParamSpec> job_specs();

}  // namespace diorama
