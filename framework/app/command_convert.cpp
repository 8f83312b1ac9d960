// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_convert.h"

#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "diorama/writer.h"
#include "framework/config/joined.h"
#include "framework/config/json_text.h"
#include "framework/config/yaml_config.h"
#include "framework/datasets/conversion.h"
#include "framework/datasets/dataset_origin.h"
#include "framework/datasets/dataset_output.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/host/progress_bar.h"
#include "framework/jobs/assemble.h"
#include "framework/output/free_folders.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

/// A writer as the command line names it: "TYPE key=value ...", or a YAML mapping like in a job.
Value writer_entry(const std::string& text) {
  const std::string place = "--writer " + text;
  if (text.starts_with('{')) {
    Value entry = parse_yaml(text, place);
    if (entry.kind == Value::Kind::Map) return entry;
  }
  std::istringstream words(text);
  std::string type;
  words >> type;
  Value entry = Value::make_map();
  entry.set("type", Value::text(type));
  for (std::string word; words >> word;) {
    const std::size_t cut = word.find('=');
    if (cut == std::string::npos || cut == 0) {
      throw Error(ErrorKind::Usage, place + ": expected key=value, got '" + word + "'");
    }
    entry.set(word.substr(0, cut), parse_yaml(word.substr(cut + 1), place));
  }
  return entry;
}

std::string free_name(const std::string& wanted, const std::vector<NamedWriter>& taken) {
  const auto is_taken = [&](const std::string& name) {
    return std::ranges::any_of(taken, [&](const NamedWriter& each) { return each.name == name; });
  };
  std::string name = wanted;
  for (int i = 2; is_taken(name); ++i) name = wanted + "_" + std::to_string(i);
  return name;
}

struct ChosenWriters {
  std::vector<NamedWriter> writers;
  std::vector<Value> entries;                ///< What each of them was made of.
  OrderedJson pages = OrderedJson::array();  ///< For dataset.json.

  NameSet needs() const {
    NameSet all;
    for (const NamedWriter& each : writers) all.merge(each.writer->needs());
    return all;
  }
};

constexpr std::array<std::string_view, 2> kKeys{"type", "name"};

ChosenWriters make_writers(const std::vector<std::string>& texts, Registry& registry, Host& host) {
  ChosenWriters chosen;
  Diagnostics diagnostics;
  for (const std::string& text : texts) {
    const Value entry = writer_entry(text);
    auto writer = registry.make<Writer>(entry, "--writer", kKeys, diagnostics, host);
    if (!writer) continue;
    const std::string& type = entry.find("type")->scalar;
    const Value* own = entry.find("name");
    const std::string name = free_name(own ? own->scalar : type, chosen.writers);
    const bool is_plain = !name.starts_with('.') && name.find('/') == std::string::npos;
    if (!is_plain) {
      throw Error(ErrorKind::Usage, "--writer " + text + ": its name becomes a folder and may " +
                                        "neither begin with '.' nor hold '/'");
    }
    chosen.pages.push_back({{"name", name}, {"type", type}, {"folder", name}});
    chosen.writers.push_back({name, std::move(writer)});
    chosen.entries.push_back(entry);
  }
  diagnostics.raise();
  return chosen;
}

ConversionSource open_source(const fs::path& folder, const ConvertOptions& options,
                             DatasetReaders& readers, Host& host) {
  const FoundDataset found = find_dataset(folder, readers, options.reader);
  ConversionSource source{found.folder, readers.open(found.folder, found.reader), {}, {}, {}, {}};
  source.info = dataset_info_of(found.folder, *source.data, host);
  return source;
}

NameSet lacking_channels(const std::vector<ConversionSource>& sources, const NameSet& needs) {
  NameSet all;
  for (const ConversionSource& source : sources) all.merge(lacking_channels(source, needs));
  return all;
}

/// Null where parameters do not go together.
std::unique_ptr<Writer> writer_or_none(const Value& entry, Registry& registry, Host& host) {
  Diagnostics ignored;
  try {
    return registry.make<Writer>(entry, "--writer", kKeys, ignored, host);
  } catch (const Error&) {
    return nullptr;
  }
}

/// Where sources lack what a writer needs, switches its parameters off that need it: those that
/// are on without being asked for. Returns what was done, a line for each writer.
std::vector<std::string> go_without(ChosenWriters& chosen,
                                    const std::vector<ConversionSource>& sources,
                                    Registry& registry, Host& host) {
  const bool have_boxes = std::ranges::all_of(sources, [](const ConversionSource& source) {
    return source.holds.contains(kHoldsTightBoxes);
  });
  std::vector<std::string> notes;
  for (std::size_t i = 0; i < chosen.writers.size(); ++i) {
    NamedWriter& own = chosen.writers[i];
    const NameSet lacking = lacking_channels(sources, own.writer->needs());
    // Nothing but ids of pixels would tell where objects are.
    if (lacking.empty() || (lacking.contains(kInstanceId.name) && !have_boxes)) continue;
    Value& entry = chosen.entries[i];
    NameSet rest = lacking;
    std::string switched;
    for (const ParamSpec& param :
         registry.describe(ComponentKind::Writer, entry.find("type")->scalar)) {
      const bool is_on = param.type == ParamType::Bool && param.default_value.scalar == "true";
      if (rest.empty() || !is_on || entry.find(param.key)) continue;
      Value without = entry;
      without.set(param.key, Value::boolean(false));
      auto writer = writer_or_none(without, registry, host);
      if (!writer) continue;
      NameSet still = lacking_channels(sources, writer->needs());
      if (still.size() >= rest.size()) continue;
      rest = std::move(still);
      own.writer = std::move(writer);
      entry = std::move(without);
      switched += " " + param.key + "=false";
    }
    if (switched.empty()) continue;
    notes.push_back("--writer " + own.name + ": is taken with" + switched + ", as not all of " +
                    joined(lacking) + " is held");
  }
  return notes;
}

/// A writer that was told to do without ids of pixels takes objects from their boxes: there would
/// be none without those.
void require_boxes(const ChosenWriters& chosen, const std::vector<ConversionSource>& sources,
                   Registry& registry, Host& host) {
  const std::string ids(kInstanceId.name);
  const auto boxless = std::ranges::find_if(sources, [&](const ConversionSource& source) {
    return !source.holds.contains(kHoldsTightBoxes) && !source.holds.contains(ids);
  });
  if (boxless == sources.end()) return;
  for (std::size_t i = 0; i < chosen.writers.size(); ++i) {
    if (chosen.writers[i].writer->needs().contains(ids)) continue;
    const Value& entry = chosen.entries[i];
    for (const ParamSpec& param :
         registry.describe(ComponentKind::Writer, entry.find("type")->scalar)) {
      const bool is_on = param.type == ParamType::Bool && param.default_value.scalar == "true";
      if (!is_on || !entry.find(param.key)) continue;
      Value with = entry;
      with.set(param.key, Value::boolean(true));
      const auto writer = writer_or_none(with, registry, host);
      if (!writer || !writer->needs().contains(ids)) continue;
      throw Error(ErrorKind::Usage, boxless->folder.string() + ": holds neither " +
                                        std::string(kHoldsTightBoxes) + " nor " + ids +
                                        ", so --writer " + chosen.writers[i].name + " with " +
                                        param.key + "=false would write no object; it holds " +
                                        joined(boxless->holds));
    }
  }
}

/// That of the run which the only source comes from, where there is one; else what readers know.
std::string page_text(const std::vector<fs::path>& sources, const std::vector<std::string>& formats,
                      const DatasetInfo& info, OrderedJson writers) {
  OrderedJson page;
  if (sources.size() == 1) page = parse_json_or_nothing<OrderedJson>(page_of_run(sources[0]));
  if (!page.is_object()) {
    page = OrderedJson::object();
    page["format"] = "diorama dataset 1";
    page["job"] = info.resolved_job;
    page["labels"] = OrderedJson::array();
    for (const Labels& labels : info.labels) page["labels"].push_back(labels);
  }
  page["diorama"] = info.program_version;
  page["seed"] = info.seed;
  page["captures"] = info.capture_count;
  page["cameras"] = info.camera_names;
  page["writers"] = std::move(writers);
  page["converted_from"] = formats;
  return page.dump(1, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

}  // namespace

int command_convert(const GlobalOptions& global, const ConvertOptions& options, ConsoleLog& log) {
  const JobServices services = make_services(global, log.sink());
  DatasetReaders readers(*services.registry, *services.host);
  ChosenWriters chosen = make_writers(options.writers, *services.registry, *services.host);

  std::vector<ConversionSource> sources;
  std::vector<fs::path> folders;
  std::vector<std::string> formats;
  for (const fs::path& dataset : options.datasets) {
    sources.push_back(open_source(dataset, options, readers, *services.host));
    folders.push_back(sources.back().folder);
    formats.push_back(sources.back().data->info().format);
    sources.back().info.program_version = program_version();
  }
  for (ConversionSource& source : sources) look_through(source, chosen.needs(), *services.host);
  const auto switched = go_without(chosen, sources, *services.registry, *services.host);
  require_boxes(chosen, sources, *services.registry, *services.host);
  const Conversion conversion(std::move(sources), chosen.needs());
  for (const std::string& note : switched) log.write(LogLevel::Warning, note);
  for (const std::string& note : conversion.notes()) log.write(LogLevel::Warning, note);

  const DatasetInfo& info = conversion.info();
  check_folders_are_free(output_folders_of(options.output, chosen.writers));
  const std::string page = page_text(folders, formats, info, chosen.pages);
  DatasetOutput output(options.output, std::move(chosen.writers), info.capture_count,
                       options.overwrite);
  output.open(info, page);
  ProgressBar bar(log, "captures", info.capture_count);
  output.write(
      [&](const DatasetOutput::Take& take) {
        conversion.run(*services.host, [&](Capture capture) {
          bar.update(capture.index + 1, 0);
          take(std::move(capture));
        });
      },
      *services.host);
  output.finish();
  output.close();
  log.write(LogLevel::Info, "dataset: " + options.output.string());
  return 0;
}

}  // namespace diorama
