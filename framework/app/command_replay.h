// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

/// `diorama replay` and `diorama verify`: captures were made again, and files differ.
inline constexpr int kReplayDiffers = 9;

struct ReplayOptions {
  std::filesystem::path dataset;  ///< Holds the run's dataset.json.
  std::vector<int> captures;      ///< Which; empty: `sample` of them, by chance.
  int sample = 20;
  std::uint64_t seed = 0;                       ///< Of the choice.
  std::vector<std::string> sets;                ///< Changes of the job, "key=value".
  std::optional<std::filesystem::path> output;  ///< Empty: a folder that is removed afterwards.
};

/// Makes captures of a run again, from the job and the assets that its dataset.json names, and
/// compares their files byte by byte with those that are there. Prints what differs. Returns 0 when
/// nothing does, and when `sets` are there to make a difference; else kReplayDiffers. Throws
/// Error(Usage) for captures that the dataset does not have, and what a run throws.
int command_replay(const GlobalOptions& global, const ReplayOptions& options, ConsoleLog& log);

}  // namespace diorama
