// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/conformance.h"

#include "framework/conformance/isolated.h"
#include "framework/conformance/kinds.h"
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
  }
}

void check_component(const CheckRun& run, const Subject& subject) {
  if (!check_parameters(run, subject)) return;
  try {
    check_kind(run, subject);
  } catch (...) {
    run.check("all checks can be made", [] { throw; });
  }
}

HostOptions with_threads(int threads) {
  HostOptions options;
  options.threads = threads;
  return options;
}

void check_components(Registry& registry, const Log& log, Journal& journal) {
  HostServices host(registry, with_threads(2), log);
  HostServices single_threaded_host(registry, with_threads(1), log);
  for (const ComponentEntry& entry : registry.components()) {
    const CheckRun run(journal, std::string(kind_name(entry.kind)) + "/" + entry.type);
    check_component(run, {entry, registry, host, single_threaded_host});
  }
}

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
  std::optional<Registry> registry;
  const bool loads = run.check("the library loads and registers", [&] {
    const PluginLibrary library(search.plugins.front().plugin);
    registry.emplace(std::move(search), log);
    require(registry->rejected().empty(), registry->rejected().front().reason);
  });
  if (loads) check_components(*registry, log, journal);
}

}  // namespace

std::vector<CheckResult> check_plugin(const std::filesystem::path& file, const Log& log) {
  const std::filesystem::path absolute = std::filesystem::absolute(file);
  return run_isolated(file.filename().string(),
                      [&](Journal& journal) { check_file(absolute, log, journal); });
}

}  // namespace diorama
