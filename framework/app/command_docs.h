// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "framework/app/options.h"
#include "framework/app/reference_pages.h"
#include "framework/host/console_log.h"

namespace diorama {

/// `diorama docs --dir DIR`: writes the reference pages of the program and the plugins that are
/// there, and completion for shells. Throws Error(Output).
int command_docs(const GlobalOptions& global, const std::vector<CommandPage>& commands,
                 const std::filesystem::path& folder, ConsoleLog& log);

}  // namespace diorama
