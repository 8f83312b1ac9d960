// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_sensors.h"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/writer.h"
#include "framework/app/assemble.h"
#include "framework/app/assemble_job.h"
#include "framework/app/output_check.h"
#include "framework/config/value_text.h"
#include "framework/config/yaml_config.h"
#include "framework/host/progress_bar.h"
#include "framework/output/output_store.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/writer_queue.h"
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
  effects.provides.merge(annotator.provides());
}

Effects make_effects(const fs::path& file, Registry& registry, Host& host) {
  const Value job = read_job_file(file);
  Complaints complaints;
  const std::vector<ComponentConfig> entries = read_annotators(job, complaints);
  const auto keys = host_keys(ComponentKind::Annotator, "annotators");
  Effects effects;
  for (const ComponentConfig& entry : entries) {
    effects.types.push_back(entry.type);
    effects.annotators.push_back(
        registry.make<Annotator>(entry.map, entry.path, keys, complaints, host));
  }
  complaints.raise();
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

/// A writer that names its files as the stored ones are named.
std::unique_ptr<Writer> make_writer(const StoredCaptures& stored, const Effects& effects,
                                    Registry& registry, Host& host) {
  Value entry = Value::make_map();
  entry.set("type", Value::text("BasicWriter"));
  entry.set("rgb", Value::boolean(effects.provides.contains(kColor.name)));
  entry.set("sensor_depth", Value::boolean(effects.provides.contains(kSensorDepth.name)));
  for (const char* key : {"frame_padding", "use_common_output_dir", "colorize_depth"}) {
    if (const Value* value = stored.writer().find(key)) entry.set(key, *value);
  }
  Complaints complaints;
  const std::vector<std::string_view> keys{"type"};
  auto writer = registry.make<Writer>(entry, "writer", keys, complaints, host);
  complaints.raise();
  return writer;
}

/// That of the run, with the writer of this dataset and the effects.
std::string sensors_json(const StoredCaptures& stored, const Effects& effects) {
  auto json = nlohmann::ordered_json::parse(stored.dataset_json());
  const std::string& name = stored.writer_name();
  json["writers"] = {{{"name", name}, {"type", "BasicWriter"}, {"folder", name}}};
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

class Replay {
 public:
  Replay(const StoredCaptures& stored, const Effects& effects, Writer& writer, Host& host,
         OutputStore& store)
      : stored_(stored), effects_(effects), writer_(writer), host_(host), store_(store) {}

  void run(ConsoleLog& log) {
    begin();
    constexpr std::size_t kQueueBytes = std::size_t(256) << 20;
    WriterQueue queue(std::clamp(host_.thread_count(), 1, 4), kQueueBytes,
                      [this](const PendingCapture& pending) { write(pending.capture); });
    const std::vector<int>& indices = stored_.indices();
    ProgressBar bar(log, "captures", int(indices.size()));
    for (std::size_t i = 0; i < indices.size(); ++i) {
      PendingCapture pending;
      pending.capture = annotated(i);
      queue.push(std::move(pending));
      bar.update(int(i) + 1, 0);
    }
    queue.drain();
    store_.close();
  }

 private:
  void begin() {
    Transaction transaction = store_.begin_transaction();
    CollectedFiles files(transaction, 0, stored_.writer_name());
    writer_.begin(info_of(stored_), files);
    store_.commit_begin(transaction);
  }

  Capture annotated(std::size_t place) const {
    Capture capture = stored_.read(place);
    const Scene nothing;
    for (Frame& frame : capture.frames) {
      for (std::size_t i = 0; i < effects_.annotators.size(); ++i) {
        call_component("annotator '" + effects_.types[i] + "'",
                       [&] { effects_.annotators[i]->annotate(nothing, frame); });
      }
    }
    return capture;
  }

  void write(const Capture& capture) {
    Transaction transaction = store_.capture_transaction(capture.index);
    CollectedFiles files(transaction, 0, stored_.writer_name());
    call_component("writer '" + stored_.writer_name() + "'",
                   [&] { writer_.write(capture, files); });
    store_.commit_capture(capture.index, transaction);
  }

  const StoredCaptures& stored_;
  const Effects& effects_;
  Writer& writer_;
  Host& host_;
  OutputStore& store_;
};

}  // namespace

int command_sensors(const GlobalOptions& global, const SensorsOptions& options, ConsoleLog& log) {
  const std::unique_ptr<Registry> registry = make_registry(global, log.sink());
  warn_of_rejected(*registry, log.sink());
  const std::unique_ptr<HostServices> host = make_host(*registry, global, std::nullopt, log.sink());
  const Effects effects = make_effects(options.effects, *registry, *host);
  DatasetReaders readers(*registry, *host);
  const StoredCaptures stored(options.dataset, effects.needs, readers);
  const std::unique_ptr<Writer> writer = make_writer(stored, effects, *registry, *host);

  LocalFileSystem file_system;
  const OutputFolders folders{options.output, ".", {{stored.writer_name(), stored.writer_name()}}};
  check_folders_are_free(folders);
  OutputStore::Options store_options;
  if (options.overwrite) store_options.existing = OutputStore::Existing::Overwrite;
  OutputStore store(file_system, folders, stored.capture_count(), store_options);
  const std::string dataset_json = sensors_json(stored, effects);
  store.join(dataset_json);
  store.open();
  Replay(stored, effects, *writer, *host, store).run(log);
  const std::size_t count = stored.indices().size();
  log.write(LogLevel::Info, options.output.string() + ": " + std::to_string(count) + " of " +
                                std::to_string(stored.capture_count()) + " captures");
  return 0;
}

}  // namespace diorama
