// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "diorama/config.h"
#include "framework/host/log.h"
#include "framework/jobs/job_options.h"
#include "framework/output/dataset_status.h"

namespace diorama {

/// The native job that a file and the command line mean together: the file (without one, the
/// tutorial's built-in defaults), translated when it is of the Replicator dialect, then --set in
/// order, then --seed and --output. Throws Error(Config) or Error(Usage).
Value load_job(const JobOptions& options, const Log& log);

/// The same for a job that was read already; JobOptions::job is not looked at.
Value native_job(Value job, const JobOptions& options, const Log& log);

/// The job of a dataset, with another output folder.
Value job_of(const DatasetStatus& status, const std::filesystem::path& folder);

}  // namespace diorama
