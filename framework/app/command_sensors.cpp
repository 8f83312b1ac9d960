// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_sensors.h"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/writer.h"
#include "framework/config/value_text.h"
#include "framework/config/yaml_config.h"
#include "framework/datasets/dataset_output.h"
#include "framework/host/progress_bar.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/output/free_folders.h"
#include "framework/pipeline/job.h"
#include "framework/plugins/plugin_call.h"
#include "framework/replay/stored_captures.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// The annotators of the effects file in its order.
struct Effects {
  std::vector<std::string> types;
  std::vector<std::unique_ptr<Annotator>> annotators;
  NameSet needs;         ///< Of the dataset.
  NameSet provides;      ///< In all.
  std::string resolved;  ///< YAML with every default.
};

void add_needs(const Annotator& annotator, const std::string& type, Effects& effects) {
  const NameSet stored = StoredCaptures::stored_channels();
  for (const std::string& name : annotator.needs()) {
    if (effects.provides.contains(name)) continue;
    if (!stored.contains(name)) {
      std::string known;
      for (const std::string& channel : stored) known += (known.empty() ? "" : ", ") + channel;
      throw Error(ErrorKind::Config, "annotators: " + type + " needs '" + name +
                                         "', which stored datasets do not give (they give " +
                                         known + ")");
    }
    effects.needs.insert(name);
  }
  for (const std::string& name : annotator.provides()) {
    if (effects.provides.insert(name).second) continue;
    throw Error(ErrorKind::Config,
                "annotators: " + type + " makes '" + name + "', which another entry makes already");
  }
}

Effects make_effects(const fs::path& file, Registry& registry, Host& host) {
  const Value job = read_job_file(file);
  Diagnostics diagnostics;
  const std::vector<ComponentConfig> entries = read_annotators(job, diagnostics);
  const auto keys = host_keys("annotators");
  Effects effects;
  for (const ComponentConfig& entry : entries) {
    effects.types.push_back(entry.type);
    effects.annotators.push_back(
        registry.make<Annotator>(entry.map, entry.path, keys, diagnostics, host));
  }
  diagnostics.raise();
  if (entries.empty()) {
    throw Error(ErrorKind::Config, file.string() +
                                       ": the section 'annotators' is missing or empty; name for "
                                       "example '- {type: camera_sensor}'");
  }
  for (std::size_t i = 0; i < entries.size(); ++i) {
    add_needs(*effects.annotators[i], effects.types[i], effects);
  }
  Value only = Value::make_map();
  only.set("annotators", *resolved_job(job, describe_from(registry)).find("annotators"));
  effects.resolved = to_yaml(only);
  return effects;
}

std::unique_ptr<Writer> make_writer(const Value& entry, Registry& registry, Host& host) {
  Diagnostics diagnostics;
  const std::vector<std::string_view> keys{"type"};
  auto writer = registry.make<Writer>(entry, "writer", keys, diagnostics, host);
  diagnostics.raise();
  return writer;
}

/// Counts what a writer writes, and throws it away.
class CountedFiles final : public CaptureFiles {
 public:
  void add(std::string_view, std::vector<std::byte>) override { ++count; }
  void append(std::string_view, std::span<const std::byte>) override { ++count; }
  void append_kept(std::string_view, int) override { ++count; }
  void record(std::string_view) override {}
  void keep(std::span<const std::byte>) override { ++count; }
  int count = 0;
};

int file_count(const Writer& writer, const Capture& capture) {
  CountedFiles files;
  call_component("writer", [&] { writer.write(capture, files); });
  return files.count;
}

/// The writer of the stored files, with the same names and layout, that writes what the effects
/// make: of the switches that ask for channels those are on that ask for nothing else.
std::unique_ptr<Writer> make_writer(const StoredCaptures& stored, const Effects& effects,
                                    Registry& registry, Host& host) {
  const std::string& type = stored.writer().find("type")->scalar;
  Value entry = Value::make_map();
  entry.set("type", Value::text(type));
  std::vector<std::string> switches;
  for (const ParamSpec& param : registry.describe(ComponentKind::Writer, type)) {
    const Value* value = stored.writer().find(param.key);
    if (param.type == ParamType::Bool) {
      switches.push_back(param.key);
      entry.set(param.key, Value::boolean(false));
    } else if (param.type == ParamType::Int && value) {
      entry.set(param.key, *value);
    }
  }
  const auto plain = make_writer(entry, registry, host);
  const NameSet always = plain->needs();
  const Capture sample = stored.read(0);
  const int always_files = file_count(*plain, sample);
  Value chosen = entry;
  for (const std::string& name : switches) {
    Value one = entry;
    one.set(name, Value::boolean(true));
    const auto writer = make_writer(one, registry, host);
    const NameSet needs = writer->needs();
    if (needs == always) {
      if (file_count(*writer, sample) > always_files) continue;
      // It says how files look.
      if (const Value* value = stored.writer().find(name)) chosen.set(name, *value);
      continue;
    }
    const bool is_made = std::ranges::all_of(needs, [&](const std::string& need) {
      return always.contains(need) || effects.provides.contains(need);
    });
    chosen.set(name, Value::boolean(is_made));
  }
  return make_writer(chosen, registry, host);
}

/// That of the run, with the writer of this dataset and the effects.
std::string sensors_json(const StoredCaptures& stored, const Effects& effects) {
  auto json = nlohmann::ordered_json::parse(stored.dataset_json());
  const std::string& name = stored.writer_name();
  json["writers"] = {
      {{"name", name}, {"type", stored.writer().find("type")->scalar}, {"folder", name}}};
  json["sensors"] = effects.resolved;
  return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

DatasetInfo info_of(const StoredCaptures& stored) {
  DatasetInfo info;
  info.seed = stored.seed();
  info.capture_count = stored.capture_count();
  info.camera_names = stored.camera_names();
  info.program_version = program_version();
  return info;
}

Capture annotated(const StoredCaptures& stored, std::size_t place, const Effects& effects) {
  Capture capture = stored.read(place);
  const Scene nothing;
  for (Frame& frame : capture.frames) {
    for (std::size_t i = 0; i < effects.annotators.size(); ++i) {
      call_component("annotator '" + effects.types[i] + "'",
                     [&] { effects.annotators[i]->annotate(nothing, frame); });
    }
  }
  return capture;
}

}  // namespace

int command_sensors(const GlobalOptions& global, const SensorsOptions& options, ConsoleLog& log) {
  const JobServices services = make_services(global, log.sink());
  const Effects effects = make_effects(options.effects, *services.registry, *services.host);
  DatasetReaders readers(*services.registry, *services.host);
  const StoredCaptures stored(options.dataset, effects.needs, readers);
  std::vector<NamedWriter> writers;
  writers.push_back(
      {stored.writer_name(), make_writer(stored, effects, *services.registry, *services.host)});

  check_folders_are_free(output_folders_of(options.output, writers));
  DatasetOutput output(options.output, std::move(writers), stored.capture_count(),
                       options.overwrite);
  output.open(info_of(stored), sensors_json(stored, effects));
  const std::size_t count = stored.indices().size();
  ProgressBar bar(log, "captures", int(count));
  output.write(
      [&](const DatasetOutput::Take& take) {
        for (std::size_t i = 0; i < count; ++i) {
          take(annotated(stored, i, effects));
          bar.update(int(i) + 1, 0);
        }
      },
      *services.host);
  output.close();
  log.write(LogLevel::Info, options.output.string() + ": " + std::to_string(count) + " of " +
                                std::to_string(stored.capture_count()) + " captures");
  return 0;
}

}  // namespace diorama
