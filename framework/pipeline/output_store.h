// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/writer.h"
#include "framework/pipeline/file_system.h"

namespace diorama {

/// One file of a transaction.
struct StagedFile {
  std::size_t folder = 0;  ///< Index into OutputFolders::writers, or kRecordsFolder.
  std::string path;        ///< Below that folder.
  std::vector<std::byte> bytes;
  bool is_begun =
      false;  ///< It lies in the stage already; `bytes` come behind what it holds there.
};

inline constexpr std::size_t kRecordsFolder = std::size_t(-1);

/// Takes over files of a transaction that would fill the memory, before it is committed.
class Stage {
 public:
  virtual ~Stage();
  /// Puts bytes of the file with this number on disk, behind those that it put there before.
  virtual void put(std::size_t number, StagedFile& file, std::span<const std::byte> bytes) = 0;
  /// The transaction counts: what is on disk stays there.
  virtual void release() = 0;
};

/// What becomes visible on disk together.
struct Transaction {
  std::unique_ptr<Stage> stage;  ///< Null: everything stays in memory.
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

/// Collects what writers hand over; checks paths. Where the transaction has a stage, files of more
/// than kKeptBytes do not stay in memory. Used by one thread.
class CollectedFiles final : public CaptureFiles {
 public:
  /// Adds to `transaction`, which must outlive this. `writer` is for messages.
  CollectedFiles(Transaction& transaction, std::size_t folder, std::string writer);
  static constexpr std::size_t kKeptBytes = std::size_t(256) << 10;
  /// Of all files together that grow.
  static constexpr std::size_t kKeptGrowingBytes = std::size_t(4) << 20;

  void add(std::string_view path, std::vector<std::byte> bytes) override;
  void append(std::string_view path, std::span<const std::byte> bytes) override;
  void record(std::string_view line) override;

 private:
  void check(std::string_view path) const;
  void put(std::size_t number, std::span<const std::byte> bytes);

  Transaction& transaction_;
  std::size_t folder_;
  std::string writer_;
  std::map<std::string, std::size_t, std::less<>> growing_;  ///< Numbers of files by path.
  std::size_t kept_ = 0;                                     ///< Bytes of growing files.
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

  /// Empty ones with stages; what they hold on disk goes when they are not committed. To be handed
  /// to the function of the same name.
  Transaction begin_transaction(int shard);
  Transaction capture_transaction(int capture);
  Transaction finish_transaction(int shard);

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
  class DiskStage;

  std::filesystem::path journal() const;
  std::filesystem::path journal_file(const std::string& entry) const;
  std::filesystem::path folder(std::size_t index) const;
  std::filesystem::path stage(std::size_t folder, const std::string& name) const;
  std::string capture_entry(int capture) const;
  std::set<std::size_t> used_folders(const Transaction& transaction) const;
  void commit(const std::string& entry, const std::string& stage_name,
              const Transaction& transaction);
  void write_stage(const std::string& stage_name, const Transaction& transaction);
  void write_staged(const std::filesystem::path& place, bool is_begun,
                    std::span<const std::byte> bytes);
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
