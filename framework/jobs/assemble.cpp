// SPDX-License-Identifier: Apache-2.0
#include "framework/jobs/assemble.h"

#include <cstdlib>

#include "framework/annotators/builtin_annotators.h"
#include "framework/pipeline/builtin_loaders.h"
#include "framework/plugins/on_demand_library.h"

namespace diorama {

std::string program_version() { return DIORAMA_VERSION; }

std::unique_ptr<Registry> make_registry(const GlobalOptions& options, const Log& log) {
  use_on_demand_libraries_of(options.program);
  const Environment environment = [](const char* name) -> const char* {
    return secure_getenv(name);
  };
  PluginSearch search = search_plugins(
      plugin_search_levels(options.plugin_dirs, environment, bundled_plugin_folder(options.program),
                           local_plugin_folder(options.program)),
      options.allow_unsafe_plugin_dir);
  auto registry = std::make_unique<Registry>(std::move(search), log);
  registry->add_builtin(register_builtin_loaders, program_version());
  registry->add_builtin(register_builtin_annotators, program_version());
  return registry;
}

void warn_of_rejected(const Registry& registry, const Log& log) {
  for (const RejectedPlugin& rejected : registry.rejected()) {
    log(LogLevel::Warning, "plugin refused: " + rejected.reason);
  }
}

std::optional<std::string> assets_root_of(const Value& job) {
  const Value* root = job.find("assets_root");
  if (!root || root->kind != Value::Kind::Scalar) return std::nullopt;
  return root->scalar;
}

std::vector<AssetPrefix> asset_prefixes_of(const Value& job) {
  std::vector<AssetPrefix> prefixes;
  const Value* list = job.find("asset_prefixes");
  if (!list) return prefixes;
  for (const Value& item : list->list) {
    AssetPrefix prefix;
    Diagnostics diagnostics;  // read_job() makes them
    ParamReader reader(item, "asset_prefixes", diagnostics);
    prefix.visit(reader);
    prefixes.push_back(std::move(prefix));
  }
  return prefixes;
}

int thread_count(const GlobalOptions& options) {
  return options.threads > 0 ? options.threads : ThreadPool::available_threads();
}

std::unique_ptr<HostServices> make_host(Registry& registry, const GlobalOptions& options,
                                        const std::optional<std::string>& job_assets_root,
                                        const Log& log, std::vector<AssetPrefix> asset_prefixes) {
  HostOptions host;
  host.asset_prefixes = std::move(asset_prefixes);
  host.assets_root = choose_assets_root(options.assets_root, std::getenv("DIORAMA_ASSETS_ROOT"),
                                        job_assets_root, sample_pack_folder(options.program));
  host.threads = thread_count(options);
  host.asset_cache_bytes = std::size_t(options.asset_cache_mib) << 20;
  host.picture_bytes = std::uint64_t(options.picture_mib) << 20;
  return std::make_unique<HostServices>(registry, host, log);
}

JobServices make_job_services(const GlobalOptions& options, const Value& job, const Log& log,
                              void (*more)(Registrar&)) {
  JobServices services;
  services.registry = make_registry(options, log);
  if (more) services.registry->add_builtin(more, program_version());
  warn_of_rejected(*services.registry, log);
  const std::optional<std::string> job_root = assets_root_of(job);
  services.host = make_host(*services.registry, options, job_root, log, asset_prefixes_of(job));
  services.assets_root = choose_assets_root(options.assets_root, std::getenv("DIORAMA_ASSETS_ROOT"),
                                            job_root, sample_pack_folder(options.program));
  return services;
}

JobServices make_services(const GlobalOptions& options, const Log& log) {
  return make_job_services(options, Value(), log);
}

}  // namespace diorama
