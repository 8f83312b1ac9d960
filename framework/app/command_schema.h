// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "framework/app/job_schema.h"
#include "framework/app/options.h"
#include "framework/host/console_log.h"
#include "framework/plugins/registry.h"

namespace diorama {

/// `diorama schema`: prints the JSON Schema of native jobs for the plugins that are there. Loads
/// all plugins.
int command_schema(const GlobalOptions& global, ConsoleLog& log);

/// All components with their parameters. Those whose plugins cannot be loaded are left out with a
/// warning.
std::vector<DescribedComponent> describe_all(Registry& registry, const Log& log);

}  // namespace diorama
