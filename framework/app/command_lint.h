// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace diorama {

/// Exit code, beside those of ErrorKind.
inline constexpr int kLintFoundFaults = 7;

struct LintOptions {
  std::string dataset;  ///< A writer's folder, or the output folder of a run.
  bool as_json = false;
};

/// `diorama lint DATASET`: reads a dataset back and says where its files contradict each other.
/// Returns 0 when nothing was found and kLintFoundFaults otherwise; throws Error(Usage) when there
/// is no dataset.
int command_lint(const LintOptions& options);

}  // namespace diorama
