// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct SensorsOptions {
  std::filesystem::path dataset;  ///< Output folder of a run.
  std::filesystem::path effects;  ///< A job, or a file with its section `annotators` alone.
  std::filesystem::path output = "sensors";
  bool overwrite = false;
};

/// `diorama sensors DATASET --effects FILE`: lets annotators work on the linear pictures and depths
/// of a stored dataset, and writes what they make under the names of the originals: the same bytes
/// as a run with these annotators would have written. Throws Error(Usage) when the dataset does not
/// hold what they need, Error(Config) for faulty effects, Error(Asset) for damaged files.
int command_sensors(const GlobalOptions& global, const SensorsOptions& options, ConsoleLog& log);

}  // namespace diorama
