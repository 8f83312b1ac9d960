// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

/// `diorama plugins`: all components by kind, the folders that were searched and what was refused.
/// Loads no plugin that lists its components.
int command_plugins_list(const GlobalOptions& global, bool as_json, ConsoleLog& log);

/// `diorama plugins describe TYPE`: parameters with types, defaults, ranges and units. `type` may
/// be "kind/type" where kinds share a name. Throws Error(Plugin).
int command_plugins_describe(const GlobalOptions& global, const std::string& type, bool as_json,
                             ConsoleLog& log);

/// `diorama plugins check FILE`: tries what every plugin must hold
/// (framework/plugins/conformance.h). Returns 0 when all passed, else the exit code of
/// ErrorKind::Plugin.
int command_plugins_check(const std::filesystem::path& file, bool as_json, ConsoleLog& log);

}  // namespace diorama
