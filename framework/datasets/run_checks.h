// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"

namespace diorama {

/// A dataset of a run that could be opened.
struct RunDataset {
  std::string name;  ///< Its folder, for messages.
  std::shared_ptr<const StoredDataset> data;
};

/// Checks the datasets of one run against each other and against the run's dataset.json: captures
/// and cameras that are planned; the same pictures and depths; each object of a dataset is one of
/// the dataset that holds most, in the same place and always by the same class. Writers may leave
/// objects out and call them otherwise, so that only what is rare counts as a fault. Files in
/// findings begin with the dataset's name.
ReadLog check_run(const std::filesystem::path& run, const std::vector<RunDataset>& datasets,
                  Host& host);

}  // namespace diorama
