// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "framework/lint/lint_report.h"

namespace diorama {

/// Reads back every dataset below `folder` (the folder itself, or those of the writers inside it)
/// with readers of its own and checks that the files agree with each other. Faults of the data
/// become findings. Throws Error(Usage) when the folder is missing or holds no dataset of a known
/// format.
std::vector<LintReport> lint_datasets(const std::filesystem::path& folder);

}  // namespace diorama
