// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/writer.h"
#include "framework/pipeline/file_system.h"

namespace diorama {

/// One file of a transaction, still in memory.
struct StagedFile {
  std::size_t folder = 0;  ///< Index into OutputFolders::writers, or kRecordsFolder.
  std::string path;        ///< Below that folder.
  std::vector<std::byte> bytes;
};

inline constexpr std::size_t kRecordsFolder = std::size_t(-1);

/// What becomes visible on disk together.
struct Transaction {
  std::vector<StagedFile> files;
  /// Per writer that recorded something: index and line.
  std::vector<std::pair<std::size_t, std::string>> records;
};

struct OutputFolders {
  std::filesystem::path records;  ///< Holds dataset.json and the journal.
  struct WriterFolder {
    std::string name;  ///< Of the writer, unique.
    std::filesystem::path folder;
  };
  std::vector<WriterFolder> writers;
};

/// Collects what writers hand over; checks paths. Used by one thread.
class CollectedFiles final : public CaptureFiles {
 public:
  /// Adds to `transaction`, which must outlive this. `writer` is for messages.
  CollectedFiles(Transaction& transaction, std::size_t folder, std::string writer);
  void add(std::string_view path, std::vector<std::byte> bytes) override;
  void record(std::string_view line) override;

 private:
  Transaction& transaction_;
  std::size_t folder_;
  std::string writer_;
};

/// A dataset on disk. Each capture is a transaction: its files are written to a stage folder beside
/// their place, then one journal entry makes them count (atomic rename), then they are moved to
/// their names. What was cut short before the entry leaves no trace but the stage folder; what was
/// cut short after it is completed by the next open(). So a killed run leaves whole captures only.
///
/// Layout: `<records>/dataset.json`, `<records>/.diorama/journal/000012.json`, and
/// `<folder>/.diorama-stage` while a run goes on.
class OutputStore {
 public:
  /// `file_system` must outlive the store. `capture_count` is that of the whole job.
  OutputStore(FileSystem& file_system, OutputFolders folders, int capture_count);

  enum class Existing : std::uint8_t { Refuse, Resume, Overwrite };

  /// Throws Error(Output) when the folders cannot be written; leaves nothing behind. Also throws
  /// when the folder holds a dataset that `existing` does not allow: for Refuse any, for Resume one
  /// whose dataset.json differs from `dataset_json`. Reads the journal.
  void check(const std::string& dataset_json, Existing existing);
  /// Starts writing: removes the old dataset (Overwrite), completes what a killed run began, and
  /// clears stages of the captures in `own`. After check().
  void open(Existing existing, const std::set<int>& own);

  bool is_done(int capture) const { return done_.contains(capture); }
  bool is_complete() const { return int(done_.size()) == capture_count_; }
  bool is_finished() const { return is_finished_; }  ///< finish files are there, too.
  int done_count() const { return int(done_.size()); }

  /// Makes a capture appear. Safe from any thread. Throws Error(Output); then nothing of it shows.
  void commit_capture(int capture, const Transaction& transaction);
  /// Files that belong to no capture. `shard` keeps the stages of parallel runs apart.
  void commit_begin(const Transaction& transaction, int shard);
  void commit_finish(const Transaction& transaction, int shard);
  /// Looks again for captures that other shards have finished meanwhile.
  void refresh();
  /// Records of one writer in capture order.
  void read_records(std::size_t writer, const RecordVisitor& visit) const;
  /// Removes the stage folders when nothing is in them.
  void close();

  std::uint64_t bytes_written() const { return bytes_written_; }
  const OutputFolders& folders() const { return folders_; }

 private:
  std::filesystem::path journal() const;
  std::filesystem::path journal_file(const std::string& entry) const;
  std::filesystem::path folder(std::size_t index) const;
  std::filesystem::path stage(std::size_t folder, const std::string& name) const;
  std::string capture_entry(int capture) const;
  std::set<std::size_t> used_folders(const Transaction& transaction) const;
  void commit(const std::string& entry, const std::string& stage_name,
              const Transaction& transaction);
  void write_stage(const std::string& stage_name, const Transaction& transaction);
  void publish(const std::string& stage_name,
               const std::vector<std::pair<std::size_t, std::string>>& files);
  void clear_stage(const std::string& stage_name, const std::set<std::size_t>& folders);
  std::vector<std::pair<std::size_t, std::string>> journalled_files(const std::string& entry) const;
  void probe(const std::filesystem::path& folder);
  void check_same_dataset(const std::string& dataset_json) const;
  void remove_entries(bool captures_only);
  void remove_old_dataset();
  void read_journal();

  FileSystem& file_system_;
  OutputFolders folders_;
  int capture_count_;
  std::set<int> done_;
  bool is_finished_ = false;
  std::atomic<std::uint64_t> bytes_written_ = 0;
};

}  // namespace diorama
