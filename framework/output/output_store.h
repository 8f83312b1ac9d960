// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <shared_mutex>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "diorama/writer.h"
#include "framework/output/file_system.h"
#include "framework/output/journal.h"
#include "framework/output/workers.h"

namespace diorama {

/// One file of a transaction.
struct StagedFile {
  std::size_t folder = 0;  ///< Index into OutputFolders::writers, or kRecordsFolder.
  std::string path;        ///< Below that folder.
  std::vector<std::byte> bytes;
  /// What lies in the stage already, in front of `bytes`; null when nothing does.
  std::shared_ptr<Digest> staged = nullptr;
  std::uint64_t staged_size = 0;
  bool is_kept = false;  ///< What its writer keeps for finish(); has no path.
};

inline constexpr std::size_t kRecordsFolder = std::size_t(-1);

/// Takes over files of a transaction that would fill the memory, before it is committed.
class Stage {
 public:
  virtual ~Stage();
  /// Puts the file's bytes on disk, behind those that it put there before, and empties them.
  virtual void put(std::size_t number, StagedFile& file) = 0;
  /// The transaction counts: what is on disk stays there.
  virtual void release() = 0;
};

using BytesVisitor = std::function<void(std::span<const std::byte>)>;

/// What becomes visible on disk together.
struct Transaction {
  std::unique_ptr<Stage> stage = nullptr;  ///< Null: everything stays in memory.
  std::vector<StagedFile> files = {};
  std::vector<std::size_t> growing = {};  ///< Numbers of those that writers append to.
  std::size_t growing_bytes = 0;          ///< Of them all, in memory.
  /// Per writer that recorded something: index (or kRecordsFolder, for the run itself) and line.
  std::vector<std::pair<std::size_t, std::string>> records = {};
  /// Of the dataset's end: what captures kept for a writer, piece by piece. Throws Error(Output)
  /// when it is not there.
  std::function<void(std::size_t writer, int capture, const BytesVisitor&)> read_kept = {};
};

/// Where a run writes: all of it below one folder, on one file system.
struct OutputFolders {
  std::filesystem::path base;
  std::string records;  ///< Holds dataset.json and `.diorama`; below base, "." for base itself.
  struct WriterFolder {
    std::string name;    ///< Of the writer, unique.
    std::string folder;  ///< Below base, or ".".
  };
  std::vector<WriterFolder> writers;

  /// Of a writer or kRecordsFolder, below base.
  const std::string& folder(std::size_t index) const;
  /// Of a writer; of kRecordsFolder empty, as no writer's is.
  std::string name(std::size_t index) const;
  std::filesystem::path records_path() const;
};

/// Collects what writers hand over; checks paths. Where the transaction has a stage, files of more
/// than kKeptBytes do not stay in memory. Used by one thread.
class CollectedFiles final : public CaptureFiles {
 public:
  /// Adds to `transaction`, which must outlive this. `writer` is for messages.
  CollectedFiles(Transaction& transaction, std::size_t folder, std::string writer);
  static constexpr std::size_t kKeptBytes = std::size_t(256) << 10;
  /// Of all files of a transaction together that grow.
  static constexpr std::size_t kKeptGrowingBytes = std::size_t(256) << 10;

  void add(std::string_view path, std::vector<std::byte> bytes) override;
  void append(std::string_view path, std::span<const std::byte> bytes) override;
  void append_kept(std::string_view path, int capture) override;
  void record(std::string_view line) override;
  void keep(std::span<const std::byte> bytes) override;

 private:
  void check_path(std::string_view path) const;
  void stage_if_large(std::size_t number);
  void grow(std::size_t number, std::span<const std::byte> bytes);

  Transaction& transaction_;
  std::size_t folder_;
  std::string writer_;
  std::map<std::string, std::size_t, std::less<>> growing_;  ///< Numbers of files by path.
  std::optional<std::size_t> kept_;                          ///< Number of what is kept.
};

/// A dataset on disk, and one worker's part in it. Each capture is a transaction: its files are
/// written to the worker's own stage and synced, a line in its journal makes them count, then they
/// are moved to their names. What was cut short before that line leaves no trace but the stage;
/// what was cut short after it is completed by whoever joins next. So a killed run, or a power cut,
/// leaves whole captures only, and any number of workers share a folder: nobody touches another's
/// stage or journal while it lives, a file that exists is never replaced, and captures are the same
/// bytes whoever makes them (ADR 0004).
///
/// Layout: `<records>/dataset.json` and `<records>/.diorama/` with `journal/` (see Journals),
/// `workers/` and `claims/` (see Workers), `stage/<worker>/` while a run goes on, and
/// `kept/<writer>/<capture>` until the dataset is finished (ADR 0062).
class OutputStore {
 public:
  enum class Existing : std::uint8_t { Refuse, Resume, Overwrite };

  struct Options {
    Existing existing = Existing::Refuse;
    int shard = 0;  ///< From 0.
    int shards = 1;
    bool takes_visits = false;  ///< Instead of a shard: see claim_visit().
    bool verifies_all = false;  ///< Not only what a dead worker left: join() reads every file.
    std::chrono::seconds lease_timeout{120};
    WorkerIdentity self = this_worker();
    bool beats = true;  ///< Shows by a thread of its own that it lives.
    std::function<void(const std::string&)> warn = {};  ///< Of what had to be repaired.
  };

  /// `file_system` must outlive the store. `capture_count` is that of the whole job.
  OutputStore(FileSystem& file_system, OutputFolders folders, int capture_count, Options options);
  /// Leaves; faults are passed over.
  ~OutputStore();
  OutputStore(const OutputStore&) = delete;
  OutputStore& operator=(const OutputStore&) = delete;

  /// Takes part in the dataset: reads what is there, completes or takes back what dead workers
  /// began. Throws Error(Output) when folders cannot be written, hold a dataset that
  /// Options::existing does not allow (for Refuse any, for Resume one whose dataset.json differs),
  /// or a journal that is none; Busy when a living worker has this part. Then it leaves nothing
  /// behind.
  void join(const std::string& dataset_json);
  /// Before the first commit: removes the old dataset (Overwrite), and makes dataset.json, which
  /// only one job can.
  void open();

  bool is_done(int capture) const;
  int done_count() const;
  bool is_complete() const { return done_count() == capture_count_; }
  bool is_finished() const;  ///< Begin and finish files are there, too.

  /// Empty ones with stages; what they hold on disk goes when they are not committed. To be handed
  /// to the function of the same name.
  Transaction begin_transaction();
  Transaction capture_transaction(int capture);
  Transaction finish_transaction();

  /// Makes a capture appear. Safe from any thread. Throws Error(Output), then nothing of it shows;
  /// Busy when others took this worker for dead.
  void commit_capture(int capture, Transaction& transaction);
  /// Files that belong to no capture; nothing happens when they are there.
  void commit_begin(Transaction& transaction);
  /// Of all workers that find the dataset complete, one may make the finish files.
  bool claim_finish();
  void commit_finish(Transaction& transaction);

  /// With takes_visits: a visit that `needs_work` and that no living worker has; empty when there
  /// is none.
  std::optional<int> claim_visit(int visit_count, const std::function<bool(int)>& needs_work);

  /// Tells who looks on in which stages of the work this process's time has gone so far; a file of
  /// its stage, gone when it leaves. Seldom written, and passed over when it cannot be.
  void tell_times(const std::map<std::string, double>& seconds);

  /// Looks again for captures that other workers have finished meanwhile.
  void refresh();
  /// Records of one writer, or of the run itself (kRecordsFolder), in capture order.
  void read_records(std::size_t writer, const RecordVisitor& visit) const;
  /// Ends the part in an orderly way: what it wrote survives power cuts, its lease is given back.
  void close();

  std::uint64_t bytes_written() const { return bytes_written_; }

 private:
  class DiskStage;

  std::filesystem::path diorama_folder() const { return folders_.records_path() / ".diorama"; }
  std::filesystem::path dataset_file() const { return folders_.records_path() / "dataset.json"; }
  std::filesystem::path stage(const std::string& worker) const;
  std::filesystem::path staged(const std::string& worker, int entry, std::size_t file) const;
  std::filesystem::path kept_folder() const { return diorama_folder() / "kept"; }
  void read_kept(std::size_t writer, int capture, const BytesVisitor& visit);
  bool has_durable_end() const;
  void remove_kept();

  std::string role() const;
  void check_folder();
  void refuse_links() const;
  void refuse_rivals();
  void check_same_dataset() const;
  void leave();
  void start_heart();

  void settle_dead_workers();
  void settle(const std::string& worker, const WorkerIndex& index);
  bool settle_entry(const std::string& worker, const EntryPlace& place);
  void verify_all();
  void verify(const std::function<bool(int)>& is_wanted);
  void take_back(const std::string& worker, const EntryPlace& place, const std::string& reason,
                 const std::vector<JournalledFile>& damaged);
  void refuse_content(const std::filesystem::path& folder) const;
  void remove_dataset();
  bool may_remove(const JournalledFile& file);
  void remove_stage(const std::string& worker);

  enum class FileState : std::uint8_t { Right, Missing, Wrong };
  FileState state_of(const std::filesystem::path& path, const JournalledFile& file);
  void sync_later(const std::filesystem::path& folder);
  void make_target_folder(const std::filesystem::path& folder);
  /// False when something is there.
  bool move_to_place(const std::filesystem::path& source, const std::filesystem::path& target,
                     const JournalledFile& file);
  void check_no_links(const std::filesystem::path& folder);

  void check_membership();
  void commit(int entry, Transaction& transaction);
  JournalledFiles journalled(int entry, const Transaction& transaction) const;
  void write_stage(int entry, Transaction& transaction);
  void put_staged(const std::filesystem::path& place, StagedFile& file);
  void clear_stage(int entry, std::size_t files);
  void publish(int entry, const JournalledFiles& content);
  void checkpoint();
  void say(const std::string& text) const;

  FileSystem& file_system_;
  OutputFolders folders_;
  int capture_count_;
  Options options_;
  std::string dataset_json_;
  Workers workers_;
  Journals journals_;
  JournalWriter writer_;
  bool has_joined_ = false;
  bool has_opened_ = false;
  /// The old dataset is still there and does not count. Visits ask while the output begins.
  std::atomic<bool> replaces_ = false;
  std::vector<std::filesystem::path> created_;

  std::mutex folders_mutex_;
  std::set<std::filesystem::path> known_folders_;  ///< Made or found, without links.
  std::set<std::filesystem::path> unsynced_folders_;
  std::shared_mutex publishing_;  ///< Shared by commits, alone by a checkpoint.
  std::atomic<int> commits_since_checkpoint_ = 0;
  std::atomic<std::uint64_t> bytes_written_ = 0;

  std::atomic<bool> is_lost_ = false;  ///< Others took this worker for dead.
  std::mutex heart_mutex_;
  std::condition_variable heart_stops_;
  bool stops_beating_ = false;
  std::chrono::steady_clock::time_point next_times_{};
  std::thread heart_;
};

}  // namespace diorama
