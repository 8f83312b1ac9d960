// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct PreviewOptions {
  JobOptions job;
  std::vector<int> captures;  ///< Empty: three over the whole job.
  std::filesystem::path folder = "preview";
  int samples = 4;
};

/// `diorama preview JOB`: a few of a job's pictures, rendered with few samples, as PNG files in a
/// folder, and what the whole job will take. Returns the exit code. Throws Error.
int command_preview(const GlobalOptions& global, const PreviewOptions& options, ConsoleLog& log);

}  // namespace diorama
