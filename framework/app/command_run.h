// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "framework/app/options.h"
#include "framework/host/console_log.h"
#include "framework/output/dataset_status.h"

namespace diorama {

/// `diorama run JOB`. Returns the exit code: 0, or RunCommandOptions::stopped_exit_code when it was
/// asked to stop. Throws Error, and Busy when other processes have this part of the job.
int command_run(const GlobalOptions& global, const RunCommandOptions& options, ConsoleLog& log);

/// What is left to do when all captures of a dataset are there. Throws like command_run().
int finish_dataset(const GlobalOptions& global, const DatasetStatus& status, ConsoleLog& log);

/// Makes captures of `dataset` again, by its own job with `sets` on top, into the folder `output`.
/// Returns where dataset.json lies there. Throws like command_run(), and, where nothing is set,
/// require_same_assets().
std::filesystem::path make_captures_again(const GlobalOptions& global,
                                          const std::filesystem::path& dataset,
                                          const DatasetStatus& status,
                                          const std::filesystem::path& output,
                                          std::set<int> captures,
                                          const std::vector<std::string>& sets, ConsoleLog& log);

}  // namespace diorama
