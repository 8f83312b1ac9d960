// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "diorama/host.h"
#include "framework/lint/lint_report.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/job_components.h"

namespace diorama {

/// Sets the scenes of a run up anew, from its job and the assets, places everything as settle/ says
/// it stood at the end of each visit, and names objects that are no picture of things at rest: that
/// move faster than the job's `settle.rest_speed`, hang in the air or are stuck in something.
/// Visits of which settle/ says nothing, or in which nothing was simulated, are left out. Throws
/// Error(Asset) when the assets are not there.
LintReport lint_scenes(const std::filesystem::path& run, const Job& job, const CapturePlan& plan,
                       VisitComponents& components, Host& host);

}  // namespace diorama
