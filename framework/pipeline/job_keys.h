// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diorama/params.h"
#include "framework/host/asset_paths.h"

/// Keys of a job file that have no struct of their own in job.h. For job.cpp and job_defaults.cpp.
namespace diorama::detail {

/// What every entry that names a component has.
struct EntryHead {
  std::string type;
  std::string name;
  void visit(ParamVisitor& v) {
    v.param("type", type, {"Type of the component."});
    v.param("name", name, {"Name of the entry, for messages."});
  }
};

struct EngineHead {
  std::string type;
  void visit(ParamVisitor& v) { v.param("type", type, {"Type of the component."}); }
};

/// The keys of the job that are no lists.
struct JobHead {
  std::uint64_t seed = 0;
  std::optional<std::string> assets_root;
  std::vector<AssetPrefix> asset_prefixes;
  bool debug = false;
  int total_captures = 1;
  void visit(ParamVisitor& v) {
    v.param("seed", seed, {"Start of all random streams."});
    v.param("assets_root", assets_root,
            {"Folder below which asset paths are looked up; null: --assets-root, "
             "DIORAMA_ASSETS_ROOT, then the installed sample pack."});
    v.list(
        "asset_prefixes", asset_prefixes,
        {"Where names in jobs and scenes are looked up below the assets root, the longest prefix "
         "first. Without: their whole path, and what begins with /Isaac/ or /NVIDIA/ in it."});
    v.param("debug", debug,
            {"Also hides environment.hide_in_debug and writes one overview picture per "
             "environment."});
    v.param(
        "total_captures", total_captures,
        {"Captures in the whole job; environments are cycled until that many exist.", "", 0, 1e8});
  }
};

/// `simulate: STEPS`.
struct StepsKeys {
  double simulate = 0;
  void visit(ParamVisitor& v) {
    v.param("simulate", simulate, {"Fixed physics steps to take.", "", 0, 1e7});
  }
};

/// `simulate: {until: rest}`.
struct RestKeys {
  std::string until = "rest";
  int at_least = 0;
  int at_most = 800;
  void visit(ParamVisitor& v) {
    static constexpr const char* kUntil[] = {"rest"};
    v.choice("until", until, kUntil, {"What ends the simulation."});
    v.param("at_least", at_least, {"Steps that are taken in any case.", "", 0, 1e7});
    v.param("at_most", at_most, {"Steps after which it ends in any case.", "", 1, 1e7});
  }
};

/// `record: {fps: 30, seconds: 2}`.
struct RecordKeys {
  std::string name = "clip";
  double fps = 30.0;
  double seconds = 1.0;
  void visit(ParamVisitor& v) {
    v.param("name", name, {"Name of the clips: the moment that randomizers name in `on`."});
    v.param("fps", fps, {"Frames per second.", "1/s", 0.1, 1000});
    v.param("seconds", seconds, {"Length: the frames that begin within it.", "s", 0.001, 36000});
  }
};

/// All forms of a timeline step, for reading and for the reference.
struct StepKeys {
  Value simulate;
  std::optional<std::string> capture;
  int count = 1;
  Value record;
  std::optional<std::string> event;
  std::optional<std::string> each_step;
  double camera_radius_m = 0.0;
  std::optional<double> repeat;
  Value steps;
  int every = 1;
  void visit(ParamVisitor& v) {
    v.param("simulate", simulate,
            {"Fixed physics steps to take; or `{until: rest, at_least: 0, at_most: 800}`: until "
             "every object is at rest, and what is not settled then is dealt with as "
             "`settle.policy` says."});
    v.param("capture", capture, {"Name of a capture series, whose captures are taken here."});
    v.param("count", count, {"Captures of the series per visit.", "", 0, 1e6});
    v.param(
        "record", record,
        {"`{fps: 30, seconds: 2, name: clip}`: a capture every 1/fps seconds while physics goes "
         "on and cameras follow their paths; each counts among total_captures."});
    v.param("event", event, {"Calls the randomizers that name this moment."});
    v.param("each_step", each_step,
            {"Beside `simulate`: moment after each of its steps; randomizers that name it act."});
    v.param("camera_radius_m", camera_radius_m,
            {"Beside `simulate`: spheres of this radius round the cameras push objects away "
             "meanwhile; 0: none.",
             "m", 0, 1e3});
    v.param("repeat", repeat, {"Takes the `steps` of the entry so many times.", "", 0, 1e6});
    v.param("steps", steps, {"Beside `repeat`: a timeline."});
    v.param(
        "every", every,
        {"Within `steps`: taken in every so-manieth round only, from the first on.", "", 1, 1e6});
  }
};

}  // namespace diorama::detail
