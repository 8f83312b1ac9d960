// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_plugins.h"

#include <algorithm>
#include <array>
#include <iostream>
#include <sstream>

#include "framework/app/cli.h"
#include "framework/app/param_text.h"
#include "framework/app/standard_output.h"
#include "framework/config/value_text.h"
#include "framework/conformance/conformance.h"
#include "framework/jobs/assemble.h"

namespace diorama {
namespace {

using conformance::CheckResult;
using conformance::Outcome;

constexpr std::array kComponentKinds{ComponentKind::Loader,     ComponentKind::Physics,
                                     ComponentKind::Randomizer, ComponentKind::Renderer,
                                     ComponentKind::Annotator,  ComponentKind::Writer,
                                     ComponentKind::Reader};

std::string padded(std::string text, std::size_t width) {
  if (text.size() < width) text.resize(width, ' ');
  return text;
}

Value text_list(const std::vector<std::string>& words) {
  Value list = Value::make_list();
  for (const std::string& word : words) list.list.push_back(Value::text(word));
  return list;
}

Value entry_value(const ComponentEntry& entry) {
  Value value = Value::make_map();
  value.set("kind", Value::text(kind_name(entry.kind)));
  value.set("type", Value::text(entry.type));
  value.set("help", Value::text(entry.help));
  if (!entry.claims.empty()) value.set("claims", text_list(entry.claims));
  value.set("plugin", Value::text(entry.plugin));
  value.set("version", Value::text(entry.version));
  value.set("file", entry.file.empty() ? Value() : Value::text(entry.file.string()));
  return value;
}

void print_list_json(const Registry& registry) {
  Value document = Value::make_map();
  document.set("program", Value::text(program_version()));
  document.set("abi", Value::integer(DIORAMA_SDK_ABI));
  document.set("abi_tag", Value::text(DIORAMA_ABI_TAG));
  Value components = Value::make_list();
  for (const ComponentEntry& entry : registry.components()) {
    components.list.push_back(entry_value(entry));
  }
  document.set("components", std::move(components));
  Value rejected = Value::make_list();
  for (const RejectedPlugin& refusal : registry.rejected()) {
    Value value = Value::make_map();
    value.set("file", Value::text(refusal.file.string()));
    value.set("reason", Value::text(refusal.reason));
    rejected.list.push_back(std::move(value));
  }
  document.set("rejected", std::move(rejected));
  Value folders = Value::make_list();
  for (const SearchLevel& level : registry.levels()) {
    for (const auto& folder : level.folders) folders.list.push_back(Value::text(folder.string()));
  }
  document.set("searched", std::move(folders));
  std::cout << to_json(document, 2) << "\n";
}

void print_list(const Registry& registry) {
  std::ostringstream text;
  const std::vector<ComponentEntry> entries = registry.components();
  std::size_t type_width = 0;
  for (const ComponentEntry& entry : entries) {
    type_width = std::max(type_width, entry.type.size());
  }
  for (const ComponentKind kind : kComponentKinds) {
    bool is_first = true;
    for (const ComponentEntry& entry : entries) {
      if (entry.kind != kind) continue;
      if (is_first) text << kind_name(kind) << "\n";
      is_first = false;
      text << "  " << padded(entry.type, type_width) << "  " << entry.help << "  [" << entry.plugin
           << " " << entry.version << "]\n";
    }
  }
  text << (entries.empty() ? "no components\n" : "") << "searched\n";
  for (const SearchLevel& level : registry.levels()) {
    for (const auto& folder : level.folders) {
      text << "  " << folder.string() << " (" << level.name << ")\n";
    }
  }
  if (!registry.rejected().empty()) text << "refused\n";
  for (const RejectedPlugin& rejected : registry.rejected()) {
    text << "  " << rejected.reason << "\n";
  }
  print_text(text.str());
}

/// The entries that "type" or "kind/type" means.
std::vector<ComponentEntry> entries_called(const Registry& registry, const std::string& name) {
  std::vector<ComponentEntry> found;
  std::vector<std::string> names;
  for (const ComponentEntry& entry : registry.components()) {
    names.push_back(entry.type);
    const std::string full = std::string(kind_name(entry.kind)) + "/" + entry.type;
    if (name == entry.type || name == full) found.push_back(entry);
  }
  if (!found.empty()) return found;
  const std::string near = nearest_name(name, names);
  throw Error(ErrorKind::Plugin, "no component is called '" + name + "'" +
                                     (near.empty() ? "" : "; did you mean '" + near + "'?") +
                                     "; 'diorama plugins' lists them all");
}

void print_description(const ComponentEntry& entry, const std::vector<ParamSpec>& specs) {
  std::ostringstream text;
  text << kind_name(entry.kind) << " " << entry.type << ": " << entry.help << "\n";
  text << "plugin " << entry.plugin << " " << entry.version;
  if (!entry.file.empty()) text << ", " << entry.file.string();
  text << "\n";
  for (const std::string& claim : entry.claims) {
    const bool is_beginning = claim.starts_with('=');
    text << "reads "
         << (is_beginning ? "files without an ending that begin with " + claim.substr(1) : claim)
         << "\n";
  }
  if (specs.empty()) text << "no parameters\n";
  for (const ParamRow& row : param_rows(specs)) {
    text << "\n" << row.key << ": " << row.type;
    if (!row.default_value.empty()) text << ", default " << row.default_value;
    if (!row.unit.empty()) text << " " << row.unit;
    if (!row.range.empty()) text << ", " << row.range;
    text << "\n    " << row.help << "\n";
  }
  print_text(text.str());
}

std::ptrdiff_t count(const std::vector<CheckResult>& results, Outcome outcome) {
  return std::ranges::count(results, outcome, &CheckResult::outcome);
}

void print_checks(const std::vector<CheckResult>& results) {
  std::ostringstream text;
  for (const CheckResult& result : results) {
    text << padded(outcome_name(result.outcome), 8) << result.subject << ": " << result.check
         << (result.message.empty() ? "" : ": " + result.message) << "\n";
  }
  text << results.size() << " checks, " << count(results, Outcome::Failed) << " failed, "
       << count(results, Outcome::Skipped) << " skipped\n";
  print_text(text.str());
}

void print_checks_json(const std::vector<CheckResult>& results) {
  Value list = Value::make_list();
  for (const CheckResult& result : results) {
    Value value = Value::make_map();
    value.set("subject", Value::text(result.subject));
    value.set("check", Value::text(result.check));
    value.set("outcome", Value::text(outcome_name(result.outcome)));
    if (!result.message.empty()) value.set("message", Value::text(result.message));
    list.list.push_back(std::move(value));
  }
  std::cout << to_json(list, 2) << "\n";
}

}  // namespace

int command_plugins_list(const GlobalOptions& global, bool as_json, ConsoleLog& log) {
  const std::unique_ptr<Registry> registry = make_registry(global, log.sink());
  if (as_json) {
    print_list_json(*registry);
  } else {
    print_list(*registry);
  }
  return 0;
}

int command_plugins_describe(const GlobalOptions& global, const std::string& type, bool as_json,
                             ConsoleLog& log) {
  const std::unique_ptr<Registry> registry = make_registry(global, log.sink());
  warn_of_rejected(*registry, log.sink());
  Value list = Value::make_list();
  bool is_first = true;
  for (const ComponentEntry& entry : entries_called(*registry, type)) {
    const std::vector<ParamSpec> specs = registry->describe(entry.kind, entry.type);
    Value value = entry_value(entry);
    value.set("parameters", param_values(specs));
    list.list.push_back(std::move(value));
    if (as_json) continue;
    if (!is_first) std::cout << "\n";
    is_first = false;
    print_description(entry, specs);
  }
  if (as_json) std::cout << to_json(list, 2) << "\n";
  return 0;
}

int command_plugins_check(const std::filesystem::path& file, bool as_json, ConsoleLog& log) {
  const Log only_errors = [&log](LogLevel level, std::string_view text) {
    log.write(level == LogLevel::Error ? level : LogLevel::Debug, text);
  };
  const std::vector<CheckResult> results = check_plugin(file, only_errors);
  if (as_json) {
    print_checks_json(results);
  } else {
    print_checks(results);
  }
  return count(results, Outcome::Failed) == 0 ? 0 : exit_code(ErrorKind::Plugin);
}

}  // namespace diorama
