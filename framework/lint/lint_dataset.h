// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "diorama/host.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/lint/lint_report.h"

namespace diorama {

/// Reads back every dataset below `folder` (the folder itself, or those of the writers inside it)
/// and checks that the files agree with each other: what their readers find, and what must hold in
/// frames of any format. Formats that have no reader yet are read by lint itself. Faults of the
/// data become findings. Throws Error(Usage) when the folder is missing or holds no dataset of a
/// known format. Captures are read on all of the host's threads; memory does not grow with their
/// number but for a few bytes each.
std::vector<LintReport> lint_datasets(const std::filesystem::path& folder, DatasetReaders& readers,
                                      Host& host, const std::string& reader = {});

}  // namespace diorama
