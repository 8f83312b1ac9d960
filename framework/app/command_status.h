// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct StatusOptions {
  std::filesystem::path dataset;  ///< Holds dataset.json.
  bool as_json = false;
  bool verify = false;  ///< Reads every file.
};

/// 0 when the dataset is finished (and, with `verify`, right), kDatasetIncomplete otherwise.
int command_status(const StatusOptions& options);

/// Writes the finish files of a dataset whose captures are all there.
int command_finish(const GlobalOptions& global, const std::filesystem::path& dataset,
                   ConsoleLog& log);

}  // namespace diorama
