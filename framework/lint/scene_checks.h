// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "diorama/host.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/lint/lint_report.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/job_components.h"

namespace diorama {

/// Sets the scenes of a run up anew, from its job and the assets, and places everything as settle/
/// says it stood. Names objects that began inside of something; that are no picture of things at
/// rest at the end of a visit: move faster than the job's `settle.rest_speed`, hang in the air or
/// are stuck in something; and cameras, as far as the datasets of the run say where they were, that
/// stand in something or nearer to it than their near plane. Captures before the last simulation of
/// a visit show objects elsewhere: their cameras are held against the environment alone. Visits of
/// which settle/ says nothing are left out. Throws Error(Asset) when the assets are not there.
LintReport lint_scenes(const std::filesystem::path& run, const Job& job, const CapturePlan& plan,
                       VisitComponents& components, DatasetReaders& readers, Host& host);

}  // namespace diorama
