// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

/// `diorama run JOB`. Returns the exit code: 0, or 130 when interrupted. Throws Error.
int command_run(const GlobalOptions& global, const RunCommandOptions& options, ConsoleLog& log);

}  // namespace diorama
