// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "framework/host/host_services.h"
#include "framework/jobs/job_options.h"
#include "framework/plugins/registry.h"

/// The only place that says what the program is made of.
namespace diorama {

/// The program's version: "0.1.0".
std::string program_version();

/// Searches for plugins as the options and the environment say and adds the built-in components.
std::unique_ptr<Registry> make_registry(const GlobalOptions& options, const Log& log);

/// One warning for each plugin that was refused.
void warn_of_rejected(const Registry& registry, const Log& log);

/// The assets root that a native job names, if it names one.
std::optional<std::string> assets_root_of(const Value& job);

/// Its asset_prefixes, as far as they are well formed.
std::vector<AssetPrefix> asset_prefixes_of(const Value& job);

/// What a job is assembled with. The host must not outlive the registry.
struct JobServices {
  std::unique_ptr<Registry> registry;
  std::unique_ptr<HostServices> host;
  std::optional<std::filesystem::path> assets_root;
};

/// Searches for plugins as make_registry() does, warns of those that were refused, and makes host
/// services for a native job; `more`, if given, adds components of the program's own. Throws
/// Error(Asset) when the assets root is no folder.
JobServices make_job_services(const GlobalOptions& options, const Value& job, const Log& log,
                              void (*more)(Registrar&) = nullptr);

/// The same for what is no job.
JobServices make_services(const GlobalOptions& options, const Log& log);

/// How many threads host services made with these options have, the calling one included.
int thread_count(const GlobalOptions& options);

/// Host services for a job; `job_assets_root` is what the job says, if it says something. Throws
/// Error(Asset) when the assets root is no folder.
std::unique_ptr<HostServices> make_host(Registry& registry, const GlobalOptions& options,
                                        const std::optional<std::string>& job_assets_root,
                                        const Log& log,
                                        std::vector<AssetPrefix> asset_prefixes = {});

}  // namespace diorama
