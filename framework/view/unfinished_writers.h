// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "framework/host/log.h"
#include "framework/host/scratch_folder.h"
#include "framework/jobs/job_options.h"
#include "framework/output/dataset_status.h"

namespace diorama {

/// What writers would leave if a run that goes on ended now: formats whose tables are written at
/// the end are read that way before it. Main thread only.
class UnfinishedWriters {
 public:
  /// Plugins and assets are looked up as `options` say.
  UnfinishedWriters(GlobalOptions options, Log log);

  /// A folder that stands for that of a writer of the run: links to what is there, and what
  /// Writer::finish() makes of the captures that are published. It stays until the next call but
  /// one for the same folder. Nothing when no writer writes there. Throws Error when the job cannot
  /// be assembled here, or the writer needs more than its records.
  std::optional<std::filesystem::path> folder_for(const DatasetStatus& status,
                                                  const std::filesystem::path& folder);

 private:
  std::filesystem::path next_folder(const std::filesystem::path& folder);

  GlobalOptions options_;
  Log log_;
  std::optional<ScratchFolder> scratch_;
  int made_ = 0;
  std::map<std::filesystem::path, std::vector<std::filesystem::path>> folders_;  ///< Oldest first.
};

}  // namespace diorama
