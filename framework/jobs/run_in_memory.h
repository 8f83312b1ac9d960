// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/host/host_services.h"
#include "framework/jobs/assemble_job.h"
#include "framework/pipeline/pipeline.h"

namespace diorama {

/// Runs a job whose files are kept in memory and go with the call: what its writers do with
/// captures is what is left. Throws as Pipeline::run() does.
RunSummary run_in_memory(JobAssembly& assembly, HostServices& host, const RunOptions& options);

}  // namespace diorama
