// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "framework/images/image_codecs.h"

namespace diorama {

/// What the command line says for every command.
struct GlobalOptions {
  std::filesystem::path program;  ///< The running executable, links resolved.
  LogLevel log_level = LogLevel::Info;
  int threads = 0;  ///< 0: as many as the machine offers.
  int picture_mib = int(kPictureBudget >> 20);
  std::vector<std::filesystem::path> plugin_dirs;
  bool allow_unsafe_plugin_dir = false;
  std::optional<std::filesystem::path> assets_root;
};

/// What it says of the job, for commands that take one.
struct JobOptions {
  std::filesystem::path job;      ///< Empty: the built-in one.
  std::vector<std::string> sets;  ///< "key=value", in order.
  std::optional<std::uint64_t> seed;
  std::optional<std::string> output;  ///< Output folder.
};

/// What it says of the run.
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
  int queue_mib = 256;
  int visits_in_flight = 0;  ///< 0: see default_visits_in_flight().
  bool overwrite = false;
  bool only_finishes = false;  ///< See RunOptions.
  std::optional<std::set<int>> only = {};
  bool plan = false;     ///< Checks the job and plans it, opens no asset.
  bool dry_run = false;  ///< The same, then estimates what a run takes.
};

}  // namespace diorama
