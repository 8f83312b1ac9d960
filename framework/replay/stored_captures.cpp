// SPDX-License-Identifier: Apache-2.0
#include "framework/replay/stored_captures.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "diorama/error.h"
#include "framework/config/joined.h"
#include "framework/config/json_text.h"
#include "framework/config/yaml_config.h"
#include "framework/datasets/conversion.h"
#include "framework/output/file_system.h"
#include "framework/pipeline/capture_plan.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// What `holds` lacks of what sensors need.
NameSet lacking(const NameSet& channels, const NameSet& holds) {
  NameSet lack;
  for (const std::string& name : channels) {
    if (!holds.contains(name)) lack.insert(name);
  }
  if (!holds.contains(kHoldsCamera)) lack.emplace(kHoldsCamera);
  return lack;
}

}  // namespace

NameSet StoredCaptures::stored_channels() {
  return {std::string(kColorHdr.name), std::string(kDistanceToImagePlane.name)};
}

StoredCaptures::StoredCaptures(const fs::path& folder, const NameSet& channels,
                               DatasetReaders& readers)
    : channels_(channels) {
  const fs::path file = folder / "dataset.json";
  if (!fs::is_regular_file(file)) {
    throw Error(ErrorKind::Usage,
                folder.string() + ": holds no dataset.json; give the output folder of a run");
  }
  dataset_json_ = LocalFileSystem().read(file);
  std::string job;
  try {
    const Json json = parse_json(dataset_json_);
    seed_ = whole_of_json<std::uint64_t>(json.at("seed"));
    capture_count_ = whole_of_json<int>(json.at("captures"));
    camera_names_ = json.at("cameras").get<std::vector<std::string>>();
    job = json.at("job").get<std::string>();
    if (capture_count_ < 0) throw std::runtime_error("a negative number of captures");
  } catch (const std::exception& error) {
    throw Error(ErrorKind::Asset, file.string() + ": is not the description of a run's dataset (" +
                                      error.what() + ")");
  }
  choose_dataset(folder, job, readers);
}

void StoredCaptures::choose_dataset(const fs::path& folder, const std::string& job,
                                    DatasetReaders& readers) {
  const Value resolved = parse_yaml(job, "job of " + folder.string());
  const Value* writers = resolved.find("writers");
  std::string found;
  for (const Value& entry : writers ? writers->list : std::vector<Value>()) {
    const Value* place = entry.find("output_dir");
    const Value* name = entry.find("name");
    if (!place || !name) continue;
    // What is made of this dataset goes into a folder of the writer's name.
    const bool is_plain = !name->scalar.empty() && !name->scalar.starts_with('.') &&
                          name->scalar.find('/') == std::string::npos;
    const fs::path relative = fs::path(place->scalar).lexically_normal();
    const bool is_below = relative.is_relative() && *relative.begin() != "..";
    if (!is_plain || !is_below) {
      throw Error(ErrorKind::Asset, (folder / "dataset.json").string() + ": its writer '" +
                                        name->scalar + "' in '" + place->scalar +
                                        "' lies outside of the dataset");
    }
    const fs::path below = (folder / relative).lexically_normal();
    const std::string reader = fs::is_directory(below) ? readers.recognise(below) : std::string();
    if (reader.empty()) continue;
    auto dataset = readers.open(below, reader);
    const NameSet lack = lacking(channels_, dataset->info().holds);
    if (!lack.empty()) {
      found += (found.empty() ? "" : "; ") + name->scalar + " lacks " + joined(lack);
      continue;
    }
    if (dataset->info().captures.empty()) {
      throw Error(ErrorKind::Usage, below.string() + ": holds no capture");
    }
    writer_ = entry;
    writer_name_ = name->scalar;
    writer_folder_ = below;
    dataset_ = std::move(dataset);
    return;
  }
  NameSet needed = channels_;
  needed.emplace(kHoldsCamera);
  throw Error(ErrorKind::Usage,
              folder.string() + ": no writer stored what the effects need, " + joined(needed) +
                  (found.empty() ? "; there is no dataset that a reader knows" : ": " + found));
}

Capture StoredCaptures::read(std::size_t i) const {
  NameSet wanted = channels_;
  wanted.emplace(kHoldsCamera);
  StoredCapture stored = dataset_->read(i, wanted);
  Capture capture;
  capture.index = stored.capture.index;
  for (const std::string& camera : camera_names_) {
    const auto frame = std::ranges::find_if(stored.capture.frames, [&](const Frame& each) {
      // One camera alone may have no name in a format.
      return each.camera_name == camera || camera_names_.size() == 1;
    });
    const bool is_whole =
        frame != stored.capture.frames.end() &&
        std::ranges::all_of(channels_, [&](const std::string& name) { return frame->has(name); });
    if (!is_whole) {
      refuse_capture(writer_folder_, stored, camera_names_.size() > 1 ? camera : std::string());
    }
    frame->camera_name = camera;
    frame->camera_path = "/Cameras/" + camera;
    frame->seed = JobStreams(seed_).render_seed(capture.index, camera);
    capture.frames.push_back(std::move(*frame));
  }
  return capture;
}

}  // namespace diorama
