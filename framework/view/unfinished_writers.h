// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "framework/host/log.h"
#include "framework/host/scratch_folder.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/job_options.h"
#include "framework/output/dataset_status.h"
#include "framework/output/output_store.h"

namespace diorama {

/// What writers would leave if a run that goes on ended now: formats whose tables are written at
/// the end are read that way before it. Main thread only.
class UnfinishedWriters {
 public:
  /// Runs of more captures, and folders with more entries beside the tables, are left alone: this
  /// is done again and again, and a folder may come from strangers.
  static constexpr int kMostCaptures = 100'000;
  static constexpr std::size_t kMostLinks = 5000;

  /// Plugins and assets are looked up as `options` say. Ends with Stopped when `stop`, which must
  /// outlive the object, becomes true.
  UnfinishedWriters(GlobalOptions options, const std::atomic<bool>& stop, Log log);

  using Folders = std::map<std::filesystem::path, std::filesystem::path>;
  /// Folders that stand for these ones of writers of the run: links to what is there, and what
  /// Writer::finish() makes of the captures that are published. They stay until the next call but
  /// one for the same folder. Those are left out into which no writer writes, whose writer needs
  /// more than its records, or of which there is too much; all are when no worker lives. Throws
  /// Error when the job cannot be assembled here.
  Folders folders_for(const DatasetStatus& status, std::span<const std::filesystem::path> folders);

 private:
  std::filesystem::path next_folder(const std::filesystem::path& folder);
  void give_up(const std::filesystem::path& folder, const std::string& why);
  std::optional<std::filesystem::path> finished(JobAssembly& assembly, const OutputFolders& places,
                                                std::size_t place, OutputStore& store,
                                                const std::filesystem::path& folder);

  GlobalOptions options_;
  const std::atomic<bool>& stop_;
  Log log_;
  std::optional<ScratchFolder> scratch_;
  int made_ = 0;
  std::map<std::filesystem::path, std::vector<std::filesystem::path>> folders_;  ///< Oldest first.
  std::set<std::filesystem::path> given_up_;
};

}  // namespace diorama
