// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

/// `diorama doctor`: versions, processor, plugin folders, every plugin loaded once, assets, and for
/// each thing that is missing how to get it. Returns 0 when nothing is missing, else the exit code
/// of ErrorKind::Plugin.
int command_doctor(const GlobalOptions& global, ConsoleLog& log);

}  // namespace diorama
