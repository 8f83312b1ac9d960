// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "framework/output/file_system.h"

namespace diorama {

/// What a dataset's folder says of itself; nothing is changed.
struct DatasetStatus {
  struct Worker {
    std::string name;
    std::string role;         ///< "shard-3-of-16", "auto", "overwrite"; empty when it has ended.
    std::string description;  ///< Host, process, last sign of life.
    bool is_alive = false;
    int captures = 0;                ///< That it has made.
    std::uint64_t memory_bytes = 0;  ///< Resident; 0: not known, as of one on another machine.
  };
  int captures = 0;  ///< Of the job.
  int done = 0;
  bool is_finished = false;
  std::vector<std::pair<int, int>> missing;  ///< Ranges, both ends included.
  std::vector<Worker> workers;
  std::vector<std::string> faults;  ///< Files that are missing or not what was written.
  std::string job;                  ///< YAML text of the resolved job.
  std::filesystem::path base;       ///< The output folder that the dataset was written to.
};

/// `folder` holds dataset.json. Throws Error(Output) when it does not, or is none. `verifies` reads
/// every file of the dataset.
DatasetStatus read_status(FileSystem& file_system, const std::filesystem::path& folder,
                          bool verifies);

/// For people; ends in a line break.
std::string status_text(const DatasetStatus& status, const std::filesystem::path& folder);
std::string status_json(const DatasetStatus& status);

}  // namespace diorama
