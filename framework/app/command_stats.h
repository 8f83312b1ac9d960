// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct StatsOptions {
  std::string dataset;  ///< A dataset's folder, or the output of a run that holds one.
  std::string reader;   ///< Type; empty: the one that knows the folder.
  bool as_json = false;
  std::filesystem::path html;  ///< File for a page of tables and pictures; empty: none.
};

/// `diorama stats DATASET`: what is in a dataset of any format that a reader knows: classes, sizes,
/// places, visibility, distances, views, brightness, pictures to look at. Returns 0; throws
/// Error(Usage) when there is no dataset.
int command_stats(const GlobalOptions& global, const StatsOptions& options, ConsoleLog& log);

}  // namespace diorama
