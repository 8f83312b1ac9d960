// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "diorama/reader.h"

namespace diorama {

/// What a dataset's own page, dataset.json, plans. Datasets of other people have none.
struct PlannedDataset {
  int captures = 0;
  std::vector<std::string> cameras;
  std::map<int, std::string> split_of_capture;
};

/// Checks that the page states conventions and origin and puts each capture into one split, and
/// that captures, cameras and classes are those that were read. Nothing when there is no such page.
std::optional<PlannedDataset> check_page(const std::filesystem::path& folder,
                                         const StoredInfo& info, ReadLog& log);

/// Checks that a capture has the frames and the split that the page plans.
void check_planned(const PlannedDataset& planned, const StoredCapture& stored, ReadLog& log);

}  // namespace diorama
