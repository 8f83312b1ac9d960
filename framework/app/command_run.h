// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/app/options.h"
#include "framework/host/console_log.h"
#include "framework/output/dataset_status.h"

namespace diorama {

/// `diorama run JOB`. Returns the exit code: 0, or RunCommandOptions::stopped_exit_code when it was
/// asked to stop. Throws Error, and Busy when other processes have this part of the job.
int command_run(const GlobalOptions& global, const RunCommandOptions& options, ConsoleLog& log);

/// What is left to do when all captures of a dataset are there. Throws like command_run().
int finish_dataset(const GlobalOptions& global, const DatasetStatus& status, ConsoleLog& log);

}  // namespace diorama
