// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct InspectOptions {
  std::string asset;  ///< A file or "scheme:rest", by the path rules of jobs.
  bool as_json = false;
  int depth = -1;  ///< Levels of the tree that are printed; negative: all.
};

/// `diorama inspect FILE`: loads the file with whichever loader claims it and prints what it holds.
/// Messages of the loader become part of the report. Throws Error(Asset) when it does not load.
int command_inspect(const GlobalOptions& global, const InspectOptions& options, ConsoleLog& log);

}  // namespace diorama
