// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/scene_checks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "framework/config/json_text.h"
#include "framework/datasets/capture_sweep.h"
#include "framework/datasets/check_names.h"
#include "framework/host/regular_file.h"
#include "framework/lint/support_check.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/pipeline/settling.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr const char* kAgrees = "settle/ agrees with the job";
constexpr const char* kRests = "objects at rest rest on something";
constexpr const char* kBegins = "objects begin clear of everything";
constexpr const char* kSees = "cameras stand clear of everything";

/// Metres; no room is as large.
constexpr double kFarthest = 1e6;

/// What settle/ says of one visit.
struct VisitRecord {
  int visit = 0;
  double simulated_s = 0.0;
  double step_s = 0.0;
  std::vector<ObjectAtEnd> objects;
  std::vector<PlacedNode> born;
  std::vector<PlacedNode> placed;
};

/// Where a camera was in one capture.
struct RecordedCamera {
  std::string name;
  Vec3 place = Vec3::Zero();  ///< World.
};

/// By capture, as the first dataset of the run tells it that knows where cameras are.
using RecordedCameras = std::map<int, std::vector<RecordedCamera>>;

double number(const Json& json) {
  const double value = json.get<double>();
  if (!(std::abs(value) <= kFarthest)) {
    throw std::runtime_error(json.dump() + " is not a number of at most 1e6");
  }
  return value;
}

template <std::size_t kCount>
std::array<double, kCount> numbers(const Json& json, const char* key) {
  if (!json.is_array() || json.size() != kCount) {
    throw std::runtime_error(std::string(key) + " is no list of " + std::to_string(kCount) +
                             " numbers");
  }
  std::array<double, kCount> values;
  for (std::size_t i = 0; i < kCount; ++i) values[i] = number(json[i]);
  return values;
}

std::vector<PlacedNode> placed_nodes(const Json& list) {
  std::vector<PlacedNode> nodes;
  for (const Json& entry : list) {
    PlacedNode& node = nodes.emplace_back();
    node.path = entry.at("node").get<std::string>();
    node.is_visible = entry.at("visible").get<bool>();
    const auto rows = numbers<12>(entry.at("parent_from_node"), "parent_from_node");
    for (std::size_t i = 0; i < rows.size(); ++i) {
      node.parent_from_node.matrix()(Eigen::Index(i / 4), Eigen::Index(i % 4)) = rows[i];
    }
  }
  return nodes;
}

/// Nothing when the file is of a program that did not write where things stood.
std::optional<VisitRecord> read_record(const fs::path& file) {
  std::ifstream in = open_regular_file(file);
  std::ostringstream text;
  text << in.rdbuf();
  const Json json = parse_json(text.str());
  if (!json.contains("objects")) return std::nullopt;
  VisitRecord record;
  record.visit = whole_of_json<int>(json.at("visit"));
  record.simulated_s = number(json.at("simulated_s"));
  record.step_s = number(json.at("step_seconds"));
  for (const Json& entry : json.at("objects")) {
    ObjectAtEnd& object = record.objects.emplace_back();
    object.path = entry.at("object").get<std::string>();
    object.falls = entry.at("falls").get<bool>();
    if (!entry.contains("before_last_step")) continue;
    const auto place = numbers<3>(entry["before_last_step"], "before_last_step");
    object.before_last_step = Vec3(place[0], place[1], place[2]);
  }
  if (json.contains("born")) record.born = placed_nodes(json["born"]);
  record.placed = placed_nodes(json.at("placed"));
  return record;
}

RecordedCameras recorded_cameras(const fs::path& run, DatasetReaders& readers, Host& host) {
  RecordedCameras cameras;
  const NameSet wanted{std::string(kHoldsCamera), std::string(kHoldsCameraPose)};
  for (const FoundDataset& found : find_datasets(run, readers, "")) {
    const auto dataset = readers.open(found.folder, found.reader);
    if (!dataset->info().holds.contains(kHoldsCameraPose)) continue;
    sweep_captures<StoredCapture>(
        *dataset, wanted, host, [](StoredCapture stored) { return stored; },
        [&](StoredCapture stored) {
          for (const Frame& frame : stored.capture.frames) {
            cameras[stored.capture.index].push_back(
                {frame.camera_path, frame.world_from_camera.translation()});
          }
        });
    return cameras;
  }
  return cameras;
}

/// After how many captures of a visit objects are where they stay.
std::int64_t captures_in_motion(const Job& job) {
  std::int64_t captures = 0;
  std::int64_t before_last = 0;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    captures += step.count;
    if (step.kind != TimelineStep::Kind::Capture) before_last = captures;
    return true;
  });
  return before_last;
}

class SceneLint {
 public:
  SceneLint(const Job& job, const CapturePlan& plan, VisitComponents& components,
            RecordedCameras cameras, Host& host, LintReport& report)
      : job_(job),
        plan_(plan),
        components_(components),
        cameras_(std::move(cameras)),
        host_(host),
        report_(report) {}

  void check(const VisitRecord& record, const std::string& file) {
    file_ = file;
    if (record.visit < 0 || record.visit >= plan_.visit_count()) {
      complain(kAgrees, "", "is of visit " + std::to_string(record.visit),
               "the job has visits 0 to " + std::to_string(plan_.visit_count() - 1));
      return;
    }
    Scene scene;
    const PlannedVisit planned = plan_.visit(record.visit);
    const NodeId environment = set_up(planned, scene);
    check_births(record, planned, scene, environment);
    if (!place(record, scene)) return;
    check_rest(record, planned, scene, environment);
    check_cameras(planned, scene, environment);
  }

 private:
  void complain(const char* check, const std::string& object, const std::string& found,
                const std::string& expected, std::optional<int> capture = std::nullopt) {
    report_.findings.push_back(lint_finding({check, file_, capture, "", object, found, expected}));
  }

  NodeId set_up(const PlannedVisit& planned, Scene& scene) {
    const EnvironmentChoice& choice = plan_.environments[planned.environment];
    const NodeId environment =
        load_environment(choice.asset, job_.environments[choice.entry],
                         *components_.environments[choice.entry], scene, host_);
    apply_environment_rules(job_.environment, job_.debug, environment, scene, host_);
    spawn_objects(plan_objects(job_, plan_.object_assets, planned.index), job_, scene, host_);
    return environment;
  }

  void check_births(const VisitRecord& record, const PlannedVisit& planned, Scene& scene,
                    NodeId environment) {
    const SavedNodes as_set_up(scene, {});
    if (record.born.empty() || !put(record.born, scene)) return;
    std::vector<JudgedObject> judged;
    for (const PlannedObject& object : plan_objects(job_, plan_.object_assets, record.visit)) {
      if (const NodeId node = scene.find(object.path)) judged.push_back({node, false});
    }
    report_.checks += judged.size();
    for (const Flaw& flaw : find_unheld(scene, environment, judged)) {
      complain(kBegins, scene.path(flaw.node), flaw.why, "", planned.first_capture);
    }
    as_set_up.restore(scene);
  }

  void check_rest(const VisitRecord& record, const PlannedVisit& planned, const Scene& scene,
                  NodeId environment) {
    // Without a simulation objects float where they were placed.
    if (record.step_s <= 0.0 || record.simulated_s <= 0.0) return;
    std::vector<JudgedObject> judged;
    for (const ObjectAtEnd& object : record.objects) {
      const NodeId node = scene.find(object.path);
      ++report_.checks;
      if (!check_speed(object, scene, node, record.step_s)) {
        judged.push_back({node, object.falls});
      }
    }
    const int last = planned.first_capture + planned.capture_count - 1;
    for (const Flaw& flaw : find_unheld(scene, environment, judged)) {
      complain(kRests, scene.path(flaw.node), flaw.why, "", last);
    }
  }

  void check_cameras(const PlannedVisit& planned, Scene& scene, NodeId environment) {
    const int end = planned.first_capture + planned.capture_count;
    const int at_rest =
        int(std::min<std::int64_t>(planned.first_capture + captures_in_motion(job_), end));
    check_cameras(at_rest, end, scene, environment);
    for (const PlannedObject& object : plan_objects(job_, plan_.object_assets, planned.index)) {
      if (const NodeId node = scene.find(object.path)) scene.edit(node).is_visible = false;
    }
    check_cameras(planned.first_capture, at_rest, scene, environment);
  }

  void check_cameras(int begin, int end, const Scene& scene, NodeId environment) {
    double near_m = kInfinity;
    for (const CameraGroup& group : job_.cameras) near_m = std::min(near_m, group.near_m);
    std::vector<JudgedCamera> judged;
    std::vector<std::pair<int, std::string>> names;
    for (auto it = cameras_.lower_bound(begin); it != cameras_.end() && it->first < end; ++it) {
      for (const RecordedCamera& camera : it->second) {
        judged.push_back({camera.place, near_m});
        names.emplace_back(it->first, camera.name);
      }
    }
    report_.checks += judged.size();
    const std::vector<std::string> reasons = find_blocked(scene, environment, judged);
    for (std::size_t i = 0; i < reasons.size(); ++i) {
      if (reasons[i].empty()) continue;
      complain(kSees, names[i].second, reasons[i], "", names[i].first);
    }
  }

  /// Takes out what the run took out, and puts the rest where it stood. False: the record is of
  /// another job.
  bool place(const VisitRecord& record, Scene& scene) {
    std::set<NodeId> there;
    for (const ObjectAtEnd& object : record.objects) {
      const NodeId node = scene.find(object.path);
      if (!node) {
        complain(kAgrees, object.path, "is no object of the visit", "");
        return false;
      }
      there.insert(node);
    }
    for (const PlannedObject& object : plan_objects(job_, plan_.object_assets, record.visit)) {
      const NodeId node = scene.find(object.path);
      if (node && !there.contains(node)) scene.erase(node);
    }
    return put(record.placed, scene);
  }

  bool put(const std::vector<PlacedNode>& nodes, Scene& scene) {
    for (const PlacedNode& placed : nodes) {
      const NodeId node = scene.find(placed.path);
      if (!node) {
        // What a randomizer of others has made cannot be made here.
        host_.log(LogLevel::Warning,
                  file_ + ": " + placed.path + " came after loading; this visit is not looked at");
        return false;
      }
      scene.set_pose(node, placed.parent_from_node);
      if (scene[node].is_visible != placed.is_visible) {
        scene.edit(node).is_visible = placed.is_visible;
      }
    }
    return true;
  }

  bool check_speed(const ObjectAtEnd& object, const Scene& scene, NodeId node, double step_s) {
    if (!object.falls || !object.before_last_step) return false;
    const double speed =
        (scene.world_from_node(node).translation() - *object.before_last_step).norm() / step_s;
    if (speed <= job_.settle.rest_speed) return false;
    char text[64];
    std::snprintf(text, sizeof text, "moves at %.2f m/s", speed);
    char limit[64];
    std::snprintf(limit, sizeof limit, "at most %g m/s", job_.settle.rest_speed);
    complain(kRests, object.path, text, limit);
    return true;
  }

  const Job& job_;
  const CapturePlan& plan_;
  VisitComponents& components_;
  RecordedCameras cameras_;
  Host& host_;
  LintReport& report_;
  std::string file_;
};

}  // namespace

LintReport lint_scenes(const fs::path& run, const Job& job, const CapturePlan& plan,
                       VisitComponents& components, DatasetReaders& readers, Host& host) {
  LintReport report;
  report.dataset = (run / "settle").string();
  report.format = "scenes";
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(run / "settle", error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".json") files.push_back(entry->path());
  }
  std::sort(files.begin(), files.end());
  SceneLint lint(job, plan, components, recorded_cameras(run, readers, host), host, report);
  for (const fs::path& file : files) {
    ++report.files;
    ++report.checks;
    std::optional<VisitRecord> record;
    try {
      record = read_record(file);
    } catch (const std::exception& wrong) {
      report.findings.push_back(lint_finding(
          {kFilesCanBeRead, file.filename().string(), std::nullopt, "", "", wrong.what(), ""}));
    }
    if (record) lint.check(*record, file.filename().string());
  }
  return report;
}

}  // namespace diorama
