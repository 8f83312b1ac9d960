// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "diorama/host.h"
#include "diorama/reader.h"
#include "diorama/writer.h"

namespace diorama {

/// The page dataset.json of the run that a dataset is part of: in the folder itself, or in the one
/// above when that page names the folder. Empty when there is none.
std::string page_of_run(const std::filesystem::path& dataset);

/// The folder of that page; nothing when there is none.
std::optional<std::filesystem::path> run_of(const std::filesystem::path& dataset);

/// The text of views.json of that run, how its views came about; empty when there is none.
std::string views_of_run(const std::filesystem::path& dataset);

/// What writers are told of a dataset that was read, as if it were rendered now: cameras, classes
/// and labels as it holds them, the captures numbered from 0 in their order, its split where the
/// format has one; seed, job, plugins and assets from its own page or its run's, as far as there is
/// one. Goes through all captures when only they say labels or splits.
DatasetInfo dataset_info_of(const std::filesystem::path& folder, const StoredDataset& dataset,
                            Host& host);

}  // namespace diorama
