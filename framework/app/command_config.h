// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

/// `diorama config JOB`: prints the job with every default written out, as YAML or JSON. Running
/// what it prints gives the same dataset. Throws Error.
int command_config(const GlobalOptions& global, const JobOptions& options, bool as_json,
                   ConsoleLog& log);

}  // namespace diorama
