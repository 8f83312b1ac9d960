// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct ExportCommandOptions {
  std::string asset;  ///< A file or "scheme:rest", by the path rules of jobs.
  std::filesystem::path file;
  bool without_physics = false;
};

/// `diorama export ASSET FILE`: loads the asset with whichever loader claims it and writes it as
/// USD, or a sky as .hdr. Throws Error.
int command_export(const GlobalOptions& global, const ExportCommandOptions& options,
                   ConsoleLog& log);

}  // namespace diorama
