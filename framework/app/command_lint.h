// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "framework/app/options.h"
#include "framework/host/console_log.h"
#include "framework/lint/lint_report.h"

namespace diorama {

/// Exit code, beside those of ErrorKind.
inline constexpr int kLintFoundFaults = 7;

struct LintOptions {
  std::string dataset;  ///< A writer's folder, or the output folder of a run.
  std::string reader;   ///< Type; empty: the one that knows the folder.
  bool as_json = false;
  bool looks_at_scenes = false;  ///< Sets the scenes of a run up anew and looks at what holds what.
};

/// `diorama lint DATASET`: reads a dataset back and says where its files contradict each other.
/// Returns 0 when nothing was found and kLintFoundFaults otherwise; throws Error(Usage) when there
/// is no dataset.
int command_lint(const GlobalOptions& global, const LintOptions& options, ConsoleLog& log);

/// Prints what was found; the exit code of the command.
int print_lint(const std::vector<LintReport>& reports, bool as_json);

}  // namespace diorama
