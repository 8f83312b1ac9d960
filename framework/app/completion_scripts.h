// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "framework/app/reference_pages.h"

namespace diorama {

/// Completion for bash, zsh and fish (`completion/`) of every command, option and kind of value
/// that the pages name. The first page is the program's; its options go with every command.
std::vector<PageFile> completion_scripts(const std::vector<CommandPage>& commands);

}  // namespace diorama
