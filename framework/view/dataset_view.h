// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/output/dataset_status.h"
#include "framework/view/byte_cache.h"
#include "framework/view/capture_index.h"
#include "framework/view/http_server.h"
#include "framework/view/index_cache.h"
#include "framework/view/run_records.h"

namespace diorama {

/// A dataset, or all of a run, and perhaps a second one beside it, as the page asks for them.
/// Addresses are made of words that stand here and of whole numbers that count datasets, captures
/// and pictures; none becomes a path.
///
///   /  /view.js  /view.css  /icon.svg       the page
///   /api/state                              which datasets, how far each is indexed
///   /api/run  /api/lint                     what dataset.json and the journals say; findings,
///                                           or why there are none: {"fault": TEXT}
///   /api/D/info  /api/D/stats               one dataset; stats may be {"fault": TEXT}, too
///   /api/D/compare/E                        in what dataset E differs from D; of all captures, or
///                                           a fault, as of /api/D/stats
///   /api/D/compare/E/N                      the same, of capture number N
///   /api/D/index/FROM                       CaptureIndex::json(), kIndexPart captures, and the
///                                           "generation" of /api/state whose places these are
///   /api/D/brightness/FROM                  CaptureIndex::brightness_json(), the same
///   /api/D/capture/N                        capture_json() of capture number N
///   /api/D/capture/N/F/KIND                 of its frame F a PictureKind, or "amodal", or "masks"
///                                           where "ids" has no content: StoredCapture::masks
class DatasetView {
 public:
  static constexpr std::size_t kIndexPart = 5000;
  static constexpr std::size_t kCacheBytes = std::size_t(96) << 20;

  struct Options {
    std::filesystem::path folder;
    /// A second dataset or run to compare with it; empty: none. Its datasets count on.
    std::filesystem::path other = {};
    double tolerance = 0.0;   ///< Of comparisons, as dataset_difference() has it.
    std::string reader = {};  ///< Type; empty: the one that knows the folder.
    /// Show no more captures than this, spread over the dataset; statistics are of all.
    std::optional<std::size_t> most_captures = {};
    /// Of IndexCache; empty: none.
    std::filesystem::path cache = {};
    /// Of a run that goes on: the folders that stand for those of writers, of which no reader makes
    /// anything yet. See UnfinishedWriters::folders_for(); may throw Error, may be empty.
    std::function<std::map<std::filesystem::path, std::filesystem::path>(
        const DatasetStatus&, std::span<const std::filesystem::path>)>
        unfinished = {};
  };

  /// Throws Error(Usage) when there is no dataset. Readers and host must outlive the object.
  DatasetView(Options options, DatasetReaders& readers, Host& host);
  ~DatasetView();

  /// Any thread.
  HttpAnswer answer(std::string_view path);

  /// On the main thread: makes what is due, and what the page has asked for: the index, statistics,
  /// findings; follows a run that goes on. False when there was nothing to do. Throws Stopped.
  bool work();

  /// Numbers of the captures shown, and their pictures, of each dataset.
  struct Shown {
    std::vector<int> captures;
    std::vector<std::string> cameras;
    NameSet holds;
  };
  std::vector<Shown> shown() const;
  const std::filesystem::path& folder() const { return options_.folder; }

 private:
  struct Opened;
  using Datasets = std::vector<std::shared_ptr<Opened>>;

  /// What was opened, and what is wrong with the folders that were not.
  struct Opening {
    std::shared_ptr<const Datasets> datasets;
    std::vector<std::string> faults;
  };
  Opening open();
  void open_below(const std::filesystem::path& folder, bool is_other, Datasets& all,
                  std::vector<std::string>& faults);
  std::shared_ptr<const Datasets> datasets() const;
  bool look_up_index(Opened& opened);
  void keep_index(Opened& opened) const;
  bool index_some(Opened& opened);
  bool brighten_some(Opened& opened);
  bool make_stats(Opened& opened);
  bool make_findings();
  bool make_comparison();
  bool follow_run();

  using Words = std::span<const std::string_view>;
  HttpAnswer state() const;
  HttpAnswer run_answer();
  HttpAnswer lint_answer();
  HttpAnswer compare_answer(const Datasets& all, std::size_t first, Words words);
  HttpAnswer dataset_answer(Opened& opened, int generation, Words words);
  HttpAnswer capture_answer(const Opened& opened, Words words);

  Options options_;
  DatasetReaders& readers_;
  Host& host_;
  IndexCache indexes_;
  mutable std::mutex mutex_;
  std::shared_ptr<const Datasets> datasets_;
  std::vector<std::string> faults_;    ///< Of datasets that could not be opened beside others.
  int generation_ = 0;                 ///< Counts how often the datasets were opened.
  int edition_ = 0;                    ///< While it stays the same, captures do: others come.
  std::atomic<std::size_t> asked_{0};  ///< The dataset that the page shows: indexed first.
  std::atomic<bool> wants_findings_{false};
  std::shared_ptr<const std::string> findings_;  ///< JSON; null until they were looked for.
  using Pair = std::pair<std::size_t, std::size_t>;
  std::map<Pair, std::shared_ptr<const std::string>> comparisons_;  ///< JSON; null: asked for.
  ByteCache<HttpAnswer> cache_{kCacheBytes};
  std::mutex records_mutex_;
  std::optional<RunRecords> records_;
  // Of the run that is followed.
  int done_ = 0;
  bool is_finished_ = true;
  std::chrono::steady_clock::time_point next_look_{};
  std::set<std::filesystem::path> unreadable_;  ///< Of its writers; no reader knows their formats.
};

}  // namespace diorama
