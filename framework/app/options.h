// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <set>

#include "framework/jobs/job_options.h"

namespace diorama {

/// What the command line says of a run.
struct RunCommandOptions {
  JobOptions job;
  int shard = 0;  ///< 0-based here; --shard counts from 1.
  int shards = 1;
  bool takes_visits = false;  ///< --shard auto.
  bool resume = false;
  bool verify = false;        ///< Reads all files of the dataset first.
  int lease_timeout_s = 120;  ///< See OutputStore::Options.
  int stopped_exit_code = 130;
  enum class Progress : std::uint8_t { Bar, Json, OpenJd };
  Progress progress = Progress::Bar;
  int queue_mib = 0;         ///< 0: as threads and memory suggest.
  int visits_in_flight = 0;  ///< 0: see default_visits_in_flight().
  bool overwrite = false;
  bool only_finishes = false;  ///< See RunOptions.
  std::optional<std::set<int>> only = {};
  /// A dataset whose captures are made again, so of the same assets.
  std::optional<std::filesystem::path> again_of = {};
  bool plan = false;     ///< Checks the job and plans it, opens no asset.
  bool dry_run = false;  ///< The same, then estimates what a run takes.
};

}  // namespace diorama
