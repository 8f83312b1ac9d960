// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/conformance.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <iterator>
#include <thread>
#include <utility>

#include "framework/conformance/isolated.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/process_state.h"
#include "framework/host/host_services.h"
#include "framework/plugins/registry.h"

namespace diorama {
namespace {

using namespace conformance;

void check_kind(const CheckRun& run, const Subject& subject) {
  switch (subject.entry.kind) {
    case ComponentKind::Loader:
      return check_loader(run, subject);
    case ComponentKind::Physics:
      return check_physics(run, subject);
    case ComponentKind::Randomizer:
      return check_randomizer(run, subject);
    case ComponentKind::Renderer:
      return check_renderer(run, subject);
    case ComponentKind::Annotator:
      return check_annotator(run, subject);
    case ComponentKind::Writer:
      return check_writer(run, subject);
    case ComponentKind::Reader:
      return check_reader(run, subject);
  }
}

std::string output_of(const Subject& subject) {
  switch (subject.entry.kind) {
    case ComponentKind::Loader:
      return loader_output(subject);
    case ComponentKind::Physics:
      return physics_output(subject);
    case ComponentKind::Randomizer:
      return randomizer_output(subject);
    case ComponentKind::Renderer:
      return renderer_output(subject);
    case ComponentKind::Annotator:
      return annotator_output(subject);
    case ComponentKind::Writer:
      return writer_output(subject);
    case ComponentKind::Reader:
      return reader_output(subject);
  }
  return {};
}

constexpr const char* kOutput = "output";

/// FNV-1a.
std::string digest(std::string_view bytes) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char byte : bytes) hash = (hash ^ std::uint8_t(byte)) * 0x100000001b3ull;
  return std::to_string(hash);
}

/// A component that fails its checks has no output to compare.
void tell_output(const Subject& subject, Journal& journal) {
  try {
    journal.fact(kOutput, digest(output_of(subject)));
  } catch (...) {
  }
}

void check_component(const CheckRun& run, const Subject& subject, Journal& journal) {
  if (!check_parameters(run, subject)) return;
  const ProcessState before;
  try {
    check_kind(run, subject);
  } catch (...) {
    run.check("all checks can be made", [] { throw; });
  }
  run.check("the process is left as it was", [&] { before.require_unchanged(); });
  tell_output(subject, journal);
}

HostOptions with_threads(int threads) {
  HostOptions options;
  options.threads = threads;
  return options;
}

/// What a component needs around it, in a process of its own.
struct Bench {
  Bench(const std::filesystem::path& file, const Log& log)
      : registry(found(file), log),
        host(registry, with_threads(2), log),
        single_threaded_host(registry, with_threads(1), log) {}

  static PluginSearch found(const std::filesystem::path& file) {
    PluginSearch search;
    search.plugins.push_back({read_plugin_file(file), 0});
    return search;
  }
  Subject subject(ComponentKind kind, const std::string& type) {
    return {registry.entry(kind, type), registry, host, single_threaded_host};
  }

  Registry registry;
  HostServices host;
  HostServices single_threaded_host;
};

/// One component type of the file.
struct Provided {
  ComponentKind kind;
  std::string type;
  std::string title;  ///< "writer/boxes"
};

/// Tries the file and tells the components in it as facts.
void check_file(const std::filesystem::path& file, const Log& log, Journal& journal) {
  const CheckRun run(journal, file.filename().string());
  PluginSearch search;
  const bool fits = run.check("the descriptor fits this program", [&] {
    search.plugins.push_back({read_plugin_file(file), 0});
  });
  if (!fits) return;
  run.check("components are listed in the file", [&] {
    const PluginFile& plugin = search.plugins.front().plugin;
    require(!plugin.learns_types || !plugin.components.empty(),
            "none are; register with DIORAMA_ADD, so that listing does not load code");
  });
  run.check("the library loads and registers", [&] {
    const ProcessState before;
    const PluginLibrary library(search.plugins.front().plugin);
    before.require_unchanged();
    const Registry registry(std::move(search), log);
    require(registry.rejected().empty(),
            registry.rejected().empty() ? "" : registry.rejected().front().reason);
    for (const ComponentEntry& entry : registry.components()) {
      journal.fact(std::to_string(int(entry.kind)) + "/" + entry.type, entry.type);
    }
  });
}

std::vector<Provided> provided_in(const std::map<std::string, std::string>& facts) {
  std::vector<Provided> components;
  for (const auto& [name, type] : facts) {
    const auto kind = ComponentKind(name.front() - '0');
    components.push_back({kind, type, std::string(kind_name(kind)) + "/" + type});
  }
  return components;
}

/// Some output depends on the second in which it is made.
void wait_for_next_second(std::time_t since) {
  while (std::time(nullptr) <= since + 1) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace

std::vector<CheckResult> check_plugin(const std::filesystem::path& file, const Log& log,
                                      const CheckLimits& limits) {
  const std::filesystem::path absolute = std::filesystem::absolute(file);
  Trial whole = run_isolated(
      file.filename().string(), [&](Journal& journal) { check_file(absolute, log, journal); }, 0,
      limits);
  std::vector<CheckResult> results = std::move(whole.results);
  std::vector<std::pair<Provided, std::string>> first_outputs;
  for (const Provided& component : provided_in(whole.facts)) {
    const auto check = [&](Journal& journal) {
      Bench bench(absolute, log);
      const CheckRun run(journal, component.title);
      check_component(run, bench.subject(component.kind, component.type), journal);
    };
    Trial trial = run_isolated(component.title, check, 0, limits);
    std::ranges::move(trial.results, std::back_inserter(results));
    const auto output = trial.facts.find(kOutput);
    if (output != trial.facts.end()) first_outputs.emplace_back(component, output->second);
  }
  const std::time_t end = std::time(nullptr);
  for (const auto& [component, first] : first_outputs) {
    const auto repeat = [&, &component = component](Journal& journal) {
      Bench bench(absolute, log);
      tell_output(bench.subject(component.kind, component.type), journal);
    };
    wait_for_next_second(end);
    const Trial again = run_isolated(component.title, repeat, 1, limits);
    const auto output = again.facts.find(kOutput);
    const bool is_same = output != again.facts.end() && output->second == first;
    results.push_back({component.title, "another process gives the same",
                       is_same ? Outcome::Passed : Outcome::Failed,
                       is_same ? ""
                               : "differs in a process with other addresses, another time and "
                                 "other environment variables"});
  }
  return results;
}

}  // namespace diorama
