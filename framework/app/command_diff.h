// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct DiffOptions {
  std::filesystem::path first;  ///< A dataset's folder, or the output of a run.
  std::filesystem::path second;
  std::string reader;      ///< Type, for both; empty: the one that knows the folder.
  double tolerance = 0.0;  ///< Of pictures, in the mean, of 255.
};

/// `diorama diff A B`: in what two datasets differ; of runs, all datasets that both have by name.
/// Like diff(1) returns 0 when nothing differs and 1 otherwise; but throws Error(Usage), exit code
/// 2, when there is nothing to compare.
int command_diff(const GlobalOptions& global, const DiffOptions& options, ConsoleLog& log);

}  // namespace diorama
