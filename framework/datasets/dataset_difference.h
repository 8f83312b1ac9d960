// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"

namespace diorama {

/// In what two datasets differ: a line each, the first kMostLines of what captures differ in.
struct DatasetDifference {
  static constexpr std::size_t kMostLines = 100;
  std::vector<std::string> pages;     ///< Jobs, versions, seeds, assets, labels.
  std::vector<std::string> contents;  ///< Formats, cameras, classes, captures, frames.
  std::int64_t captures = 0;          ///< Compared.
  std::vector<int> differing;         ///< Numbers of the captures that differ, ascending.

  bool is_empty() const { return pages.empty() && contents.empty(); }
};

/// A dataset for comparison.
struct ComparedDataset {
  std::filesystem::path folder;
  const StoredDataset& data;
};

/// Compares what both formats hold, as exactly as the coarser one holds it; pictures may be off by
/// `tolerance` (of 255) in the mean, other numbers not. Goes through all captures on the host's
/// threads.
DatasetDifference dataset_difference(const ComparedDataset& a, const ComparedDataset& b,
                                     double tolerance, Host& host);

/// In what a capture of that number differs, compared in the same way; one line when only one of
/// them has it.
std::vector<std::string> capture_difference(const StoredDataset& a, const StoredDataset& b,
                                            int capture, double tolerance);

/// Lines for what two pages dataset.json say differently.
std::vector<std::string> page_differences(const std::string& a, const std::string& b);

/// Throws Error(Asset) when the assets that `page` names, the dataset.json that the job of the
/// dataset in `folder` gives now, are not those which that dataset was made of.
void require_same_assets(const std::filesystem::path& folder, const std::string& page,
                         const std::optional<std::filesystem::path>& assets_root);

}  // namespace diorama
