// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/dataset_origin.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "framework/config/json_text.h"
#include "framework/datasets/capture_sweep.h"
#include "framework/output/file_system.h"
#include "framework/pipeline/view_report.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string read_file(const fs::path& file) {
  LocalFileSystem file_system;
  return file_system.exists(file) ? file_system.read(file) : std::string();
}

std::string read_page(const fs::path& folder) { return read_file(folder / "dataset.json"); }

/// Pages of runs list their writers.
bool is_page_of_run(const Json& page) {
  return page.is_object() && page.contains("writers") && page.at("writers").is_array();
}

bool names_folder(const Json& page, const fs::path& name) {
  return std::ranges::any_of(page.at("writers"), [&](const Json& writer) {
    return writer.is_object() && writer.contains("folder") && writer.at("folder").is_string() &&
           fs::path(writer.at("folder").get<std::string>()).lexically_normal() == name;
  });
}

fs::path plain(const fs::path& folder) {
  const fs::path normal = fs::absolute(folder).lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

/// What a page, of a dataset or of a run, says of the making. Pages of others say nothing.
void add_making(const Json& page, DatasetInfo& info) {
  info.seed = page.value("seed", info.seed);
  info.resolved_job = page.value("job", info.resolved_job);
  const auto labels = page.find("labels");
  if (labels != page.end() && labels->is_array()) {
    for (const Json& entry : *labels) info.labels.push_back(entry.get<Labels>());
  }
  const auto plugins = page.find("plugins");
  if (plugins != page.end() && plugins->is_object()) {
    for (const auto& [name, version] : plugins->items()) {
      info.plugin_versions.emplace_back(name, version.get<std::string>());
    }
  }
  const auto assets = page.find("assets");
  if (assets == page.end() || !assets->is_array()) return;
  for (const Json& entry : *assets) {
    DatasetAsset asset{entry.at("asset").get<std::string>(), {}, {}};
    for (const Json& file : entry.at("files")) {
      asset.files.emplace_back(file.at("file").get<std::string>(),
                               file.at("sha256").get<std::string>());
    }
    info.assets.push_back(std::move(asset));
  }
}

void add_making_of(const std::string& text, DatasetInfo& info) {
  const Json page = parse_json_or_nothing(text);
  if (!page.is_object()) return;
  DatasetInfo more = info;
  try {
    add_making(page, more);
  } catch (const Json::exception&) {
    return;  // somebody else's page of that name
  }
  info = std::move(more);
}

/// What of a capture tells the dataset's labels and split.
struct Front {
  std::set<Labels> labels;
  std::string split;
  std::optional<ClipFrame> clip;
};

/// Frames that are not there end a clip, and another one begins.
void add_clip_frame(const std::optional<ClipFrame>& at, int place,
                    std::vector<DatasetClip>& clips) {
  if (!at) return;
  const bool goes_on = at->frame > 0 && !clips.empty() &&
                       clips.back().first + clips.back().count == place &&
                       clips.back().fps == at->fps && clips.back().count == at->frame;
  if (!goes_on) clips.push_back({place, 0, at->fps});
  ++clips.back().count;
}

void add_from_captures(const StoredDataset& dataset, bool wants_labels, DatasetInfo& info,
                       Host& host) {
  const StoredInfo& stored = dataset.info();
  if (stored.captures.empty()) return;
  const NameSet wanted =
      wants_labels ? NameSet{std::string(kHoldsInstances), std::string(kHoldsLabels)} : NameSet{};
  const bool has_splits = !dataset.read(0, {}).split.empty();
  const bool has_clips = stored.holds.contains(kHoldsClips);
  if (!has_splits && !wants_labels && !has_clips) return;
  std::set<Labels> labels;
  std::vector<int> validation;
  int place = 0;
  sweep_captures<Front>(
      dataset, wanted, host,
      [](const StoredCapture& capture) {
        Front front{{}, capture.split, capture.capture.clip};
        for (const Frame& frame : capture.capture.frames) {
          for (const Instance& instance : frame.instances) front.labels.insert(instance.labels);
        }
        return front;
      },
      [&](Front front) {
        labels.merge(front.labels);
        // Whatever is not for training is for validation: "val", "test", "valid".
        if (!front.split.empty() && !front.split.starts_with("train")) validation.push_back(place);
        add_clip_frame(front.clip, place, info.clips);
        ++place;
      });
  labels.erase(Labels());
  if (wants_labels) info.labels.assign(labels.begin(), labels.end());
  if (has_splits) info.validation = std::move(validation);
}

}  // namespace

std::optional<fs::path> run_of(const fs::path& dataset) {
  if (is_page_of_run(parse_json_or_nothing(read_page(dataset)))) return dataset;
  const fs::path folder = plain(dataset);
  const Json page = parse_json_or_nothing(read_page(folder.parent_path()));
  if (!is_page_of_run(page) || !names_folder(page, folder.filename())) return std::nullopt;
  return folder.parent_path();
}

std::string page_of_run(const fs::path& dataset) {
  const std::optional<fs::path> run = run_of(dataset);
  return run ? read_page(*run) : std::string();
}

std::string views_of_run(const fs::path& dataset) {
  const std::optional<fs::path> run = run_of(dataset);
  return run ? read_file(*run / kViewsFile) : std::string();
}

DatasetInfo dataset_info_of(const fs::path& folder, const StoredDataset& dataset, Host& host) {
  DatasetInfo info;
  const std::string run = page_of_run(folder);
  add_making_of(run.empty() ? read_page(folder) : run, info);
  const StoredInfo& stored = dataset.info();
  info.capture_count = int(stored.captures.size());
  info.camera_names = stored.camera_names;
  info.classes = stored.classes;
  add_from_captures(dataset, info.labels.empty() && info.classes.empty(), info, host);
  return info;
}

}  // namespace diorama
