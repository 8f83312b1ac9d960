// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/dataset_description.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "diorama/error.h"
#include "framework/config/clean_text.h"
#include "framework/config/value_text.h"
#include "framework/pipeline/camera_rig.h"
#include "framework/pipeline/sha256.h"
#include "framework/pipeline/view_report.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

OrderedJson conventions() {
  return {{"length_unit", "m"},
          {"world_axes", "right-handed, z up"},
          {"camera_axes", "x right, y up, looking along -z"},
          {"matrices", "in writers' own conventions; see the writer's page"},
          {"quaternion_order", "w, x, y, z unless the writer's page says otherwise"},
          {"pixel_origin", "(0, 0) is the top left corner, its pixel's centre is (0.5, 0.5)"},
          {"distance_to_image_plane", "m along the viewing axis, +infinity for no hit"},
          {"distance_to_camera", "m from the camera's centre, +infinity for no hit"},
          {"labels", "from the ray through the pixel's centre, never filtered"}};
}

/// Names of assets, each with the labels of the objects that are made of it.
using UsedAssets = std::map<std::string, std::set<Labels>>;

UsedAssets used_assets(const Job& job, const CapturePlan& plan,
                       const std::vector<std::string>& drawn_assets) {
  UsedAssets assets;
  const auto used = std::min(plan.environments.size(), std::size_t(plan.visit_count()));
  for (std::size_t i = 0; i < used; ++i) assets.try_emplace(plan.environments[i].asset);
  for (const std::string& asset : drawn_assets) assets.try_emplace(asset);
  visit_planned_objects(job, plan, [&](const PlannedObject& object) {
    std::set<Labels>& labels = assets[object.asset];
    if (!object.labels.empty()) labels.insert(object.labels);
  });
  return assets;
}

/// Files that several assets share are read once.
std::vector<DatasetAsset> hashed_assets(const UsedAssets& used, const AssetFiles& files_of,
                                        const std::optional<fs::path>& assets_root, Host& host) {
  std::map<fs::path, std::string> hashes;
  std::map<std::string, std::vector<fs::path>> files_of_assets;
  for (const auto& [name, labels] : used) {
    std::vector<fs::path>& files = files_of_assets[name] = files_of(name);
    for (const fs::path& file : files) hashes.try_emplace(file);
  }
  std::vector<decltype(hashes)::pointer> all;
  for (auto& entry : hashes) all.push_back(&entry);
  host.parallel_for(all.size(),
                    [&](std::size_t i) { all[i]->second = file_sha256(all[i]->first); });

  std::vector<DatasetAsset> assets;
  for (const auto& [name, labels] : used) {
    DatasetAsset asset{asset_name(name, assets_root), {labels.begin(), labels.end()}, {}};
    for (const fs::path& file : files_of_assets[name]) {
      asset.files.emplace_back(asset_name(file.string(), assets_root), hashes[file]);
    }
    assets.push_back(std::move(asset));
  }
  std::sort(assets.begin(), assets.end(),
            [](const auto& a, const auto& b) { return a.asset < b.asset; });
  return assets;
}

std::string labels_text(const Labels& labels) {
  if (labels.empty()) return "-";
  std::string text;
  for (const auto& [taxonomy, label] : labels) {
    text += (text.empty() ? "" : ", ") + taxonomy + ": " + label;
  }
  return text;
}

std::string series_text(const CapturePlan& plan, const PlannedVisit& visit) {
  std::string text;
  for (const PlannedSeries& series : plan.series(visit)) {
    text += (text.empty() ? "" : ", ") + series.phase + " " + std::to_string(series.count);
  }
  return text;
}

std::string captures_text(const PlannedVisit& visit) {
  const int first = visit.first_capture;
  const int last = first + visit.capture_count - 1;
  if (first == last) return "capture " + std::to_string(first);
  return "captures " + std::to_string(first) + "-" + std::to_string(last);
}

std::string simulation_text(const TimelineStep& step) {
  if (!step.until_rest) return std::to_string(step.steps);
  return "until rest, " + std::to_string(step.at_least) + " to " + std::to_string(step.steps);
}

std::string timeline_text(const std::vector<TimelineStep>& timeline) {
  std::string text;
  for (const TimelineStep& step : timeline) {
    text += text.empty() ? "" : " -> ";
    if (step.every > 1) text += "every " + std::to_string(step.every) + ": ";
    switch (step.kind) {
      case TimelineStep::Kind::Simulate:
        text += "simulate " + simulation_text(step);
        if (step.camera_radius_m > 0.0) text += ", pushed by cameras";
        if (!step.each_step.empty()) text += ", each step " + step.each_step;
        break;
      case TimelineStep::Kind::Repeat:
        text += std::to_string(step.rounds) + " x (" + timeline_text(step.steps_of_round) + ")";
        break;
      case TimelineStep::Kind::Capture:
        text += "capture " + step.name + " x " + std::to_string(step.count);
        break;
      case TimelineStep::Kind::Record:
        text += "record " + step.name + " x " + std::to_string(step.count) + " at " +
                short_number(step.fps) + "/s";
        break;
      case TimelineStep::Kind::Event:
        text += "event " + step.name;
        break;
    }
  }
  return text;
}

/// The keys of an entry that are its component's own, in one line.
std::string parameters_text(const Value& entry, std::initializer_list<std::string_view> without) {
  Value rest = Value::make_map();
  for (const auto& [key, value] : entry.map) {
    if (std::find(without.begin(), without.end(), key) == without.end()) rest.set(key, value);
  }
  return to_json(rest, 0);
}

void add_visits(std::string& text, const CapturePlan& plan,
                const std::optional<fs::path>& assets_root) {
  // As many as anybody reads; the others go on in the same way.
  constexpr int kMostVisits = 1000;
  const int count = plan.visit_count();
  text += "visits (" + std::to_string(count) + ")\n";
  const int shown = std::min(count, kMostVisits);
  for (int i = 0; i < shown; ++i) {
    const PlannedVisit visit = plan.visit(i);
    text += "  " + std::to_string(i) + "  " +
            asset_name(plan.environments[visit.environment].asset, assets_root) + "  " +
            captures_text(visit) + ": " + series_text(plan, visit) + "\n";
  }
  if (shown < count) text += "  ... " + std::to_string(count - shown) + " more in the same order\n";
}

void add_objects(std::string& text, const CapturePlan& plan, const Job& job,
                 const std::optional<fs::path>& assets_root) {
  text += "objects (" + std::to_string(plan.objects.size()) + ")\n";
  for (std::size_t group = 0; group < job.objects.size(); ++group) {
    const auto floating = std::count_if(plan.objects.begin(), plan.objects.end(),
                                        [&](auto& o) { return o.group == group && o.floats; });
    const ObjectGroup& asked = job.objects[group];
    text += "  " + asked.name + ": ";
    if (asked.fewer > 0) text += std::to_string(asked.count - asked.fewer) + " to ";
    text += std::to_string(asked.count) + " below " + asked.under;
    if (job.objects[group].pick == "per_visit") {
      text += ", picked anew in each visit from " +
              std::to_string(plan.object_assets[group].size()) + " assets; in visit 0";
    }
    text += ", " + std::to_string(floating) + " floating\n";
    for (const PlannedObject& object : plan.objects) {
      if (object.group != group) continue;
      text += "    " + object.path + "  " + labels_text(object.labels) + "  " +
              (object.floats ? "floats" : "falls") + "  " + asset_name(object.asset, assets_root) +
              "\n";
    }
  }
}

void add_cameras(std::string& text, const Job& job) {
  text += "cameras (" + std::to_string(job.camera_names().size()) + ")\n";
  for (const CameraGroup& group : job.cameras) {
    char line[256];
    std::snprintf(line, sizeof line,
                  "  %s x %d: %s %dx%d, focal length %g mm, aperture %g mm, sees %g to %g m\n",
                  group.name.c_str(), group.count, group.type.c_str(), group.width, group.height,
                  group.focal_length_mm, group.horizontal_aperture_mm, group.near_m, group.far_m);
    text += line;
  }
}

void add_lights(std::string& text, const Job& job) {
  text += "lights\n";
  for (const LightGroup& group : job.lights) {
    text += "  " + group.name + " x " + std::to_string(group.count) + ": " + group.type + "\n";
  }
}

void add_randomizers(std::string& text, const Job& job) {
  text += "randomizers\n";
  for (const RandomizerEntry& entry : job.randomizers) {
    text += "  " + entry.name + " (" + entry.type + ") on ";
    for (std::size_t k = 0; k < entry.on.size(); ++k) text += (k > 0 ? ", " : "") + entry.on[k];
    if (entry.every > 1) text += ", every " + std::to_string(entry.every);
    text += ": " + parameters_text(entry.component.map, {"type", "name", "on", "every"}) + "\n";
  }
}

void add_annotators(std::string& text, const Job& job) {
  for (const ComponentConfig& entry : job.annotators) {
    text += "annotator " + entry.type + ": " + parameters_text(entry.map, {"type", "name"}) + "\n";
  }
}

void add_views(std::string& text, const Job& job) {
  for (const ViewRule& rule : job.views) {
    text += "views " + rule.name + ": " + parameters_text(rule.map, {"name"}) + "\n";
  }
}

void add_writers(std::string& text, const Job& job) {
  text += "writers (" + std::to_string(job.writers.size()) + ")\n";
  for (const WriterEntry& entry : job.writers) {
    text += "  " + entry.name + " (" + entry.type + ") to " +
            entry.output_dir.value_or(entry.name) + ": " +
            parameters_text(entry.component.map, {"type", "name", "output_dir"}) + "\n";
  }
}

OrderedJson rigs_json(const Job& job) {
  OrderedJson rigs = OrderedJson::object();
  for (const PlannedCamera& camera : planned_cameras(job.cameras)) {
    if (camera.rig.empty()) continue;
    OrderedJson rows = OrderedJson::array();
    const Mat4 matrix = camera.rig_from_camera.matrix();
    for (int row = 0; row < 4; ++row) {
      rows.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
    }
    rigs[camera.rig].push_back({{"camera", camera.name}, {"rig_from_camera", std::move(rows)}});
  }
  return rigs;
}

}  // namespace

DatasetInfo describe_dataset(const Job& job, const CapturePlan& plan, std::string resolved,
                             std::string program_version,
                             std::vector<std::pair<std::string, std::string>> plugin_versions,
                             const std::vector<std::string>& drawn_assets,
                             const AssetFiles& files_of, const std::optional<fs::path>& assets_root,
                             Host& host) {
  DatasetInfo info;
  info.seed = job.seed;
  info.capture_count = plan.capture_count();
  info.camera_names = job.camera_names();
  info.clips = plan.clips();
  std::set<Labels> labels;
  std::map<Labels, std::vector<std::string>> keypoints;
  visit_planned_objects(job, plan, [&](const PlannedObject& object) {
    const ObjectGroup& group = job.objects[object.group];
    for (const auto& [pattern, label] : group.part_labels) {
      Labels of_part;
      of_part.emplace(group.taxonomy, label);
      labels.insert(std::move(of_part));
    }
    if (object.labels.empty()) return;
    labels.insert(object.labels);
    for (const std::string& name : job.objects[object.group].keypoints) {
      std::vector<std::string>& names = keypoints[object.labels];
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  });
  info.labels.assign(labels.begin(), labels.end());
  info.keypoints.assign(keypoints.begin(), keypoints.end());
  info.resolved_job = std::move(resolved);
  info.program_version = std::move(program_version);
  info.plugin_versions = std::move(plugin_versions);
  info.assets = hashed_assets(used_assets(job, plan, drawn_assets), files_of, assets_root, host);
  return info;
}

std::string dataset_json(const DatasetInfo& info, const Job& job) {
  OrderedJson json;
  json["format"] = "diorama dataset 1";
  json["diorama"] = info.program_version;
  json["plugins"] = OrderedJson::object();
  for (const auto& [name, version] : info.plugin_versions) json["plugins"][name] = version;
  json["seed"] = info.seed;
  json["captures"] = info.capture_count;
  for (const DatasetClip& clip : info.clips) {
    json["clips"].push_back(
        {{"first_capture", clip.first}, {"frame_count", clip.count}, {"fps", clip.fps}});
  }
  json["cameras"] = info.camera_names;
  if (const OrderedJson rigs = rigs_json(job); !rigs.empty()) json["rigs"] = rigs;
  json["labels"] = OrderedJson::array();
  for (const Labels& labels : info.labels) {
    OrderedJson entry = OrderedJson::object();
    for (const auto& [taxonomy, label] : labels) entry[taxonomy] = label;
    json["labels"].push_back(entry);
  }
  json["writers"] = OrderedJson::array();
  for (const WriterEntry& writer : job.writers) {
    json["writers"].push_back({{"name", writer.name},
                               {"type", writer.type},
                               {"folder", writer.output_dir.value_or(writer.name)}});
  }
  if (!job.views.empty()) json["views"] = kViewsFile;
  json["conventions"] = conventions();
  json["assets"] = OrderedJson::array();
  for (const DatasetAsset& asset : info.assets) {
    OrderedJson files = OrderedJson::array();
    for (const auto& [name, hash] : asset.files) {
      files.push_back({{"file", name}, {"sha256", hash}});
    }
    json["assets"].push_back({{"asset", asset.asset}, {"files", std::move(files)}});
  }
  json["job"] = info.resolved_job;
  return json.dump(1, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

std::string asset_name(std::string_view asset, const std::optional<fs::path>& assets_root) {
  const fs::path path(asset);
  if (!assets_root || !path.is_absolute()) return clean_name(asset);
  const fs::path below = path.lexically_relative(*assets_root);
  if (below.empty() || *below.begin() == "..") return clean_name(asset);
  return clean_name("/" + below.generic_string());
}

std::string plan_text(const CapturePlan& plan, const Job& job,
                      const std::optional<fs::path>& assets_root) {
  const std::size_t cameras = job.camera_names().size();
  std::string text =
      std::to_string(plan.capture_count()) + " captures x " + std::to_string(cameras) +
      " cameras = " + std::to_string(std::size_t(plan.capture_count()) * cameras) +
      " frames, seed " + std::to_string(job.seed) + (job.debug ? ", debug" : "") + "\n";
  text += "timeline: " + timeline_text(job.timeline) + "\n";
  text += "environments (" + std::to_string(plan.environments.size()) + ")\n";
  for (const EnvironmentChoice& choice : plan.environments) {
    text += "  " + asset_name(choice.asset, assets_root) + "\n";
  }
  add_visits(text, plan, assets_root);
  add_objects(text, plan, job, assets_root);
  add_lights(text, job);
  add_cameras(text, job);
  add_randomizers(text, job);
  text +=
      "renderer " + job.renderer.type + ": " + parameters_text(job.renderer.map, {"type"}) + "\n";
  add_annotators(text, job);
  text += "physics " + job.physics.type + ": " + parameters_text(job.physics.map, {"type"}) + "\n";
  add_views(text, job);
  add_writers(text, job);
  return text;
}

}  // namespace diorama
