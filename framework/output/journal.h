// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
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

#include "framework/output/file_system.h"

namespace diorama {

/// What the workers of a dataset have written, in their own words. Each worker appends to two files
/// of its own, `<worker>.entries` (a JSON line per transaction: files with sizes and digests,
/// writers' records) and `<worker>.index` (short lines that say what became of it); so any number
/// of workers write without asking each other, and who starts reads the short ones alone.
///
/// Lines of an index, each ended by a checksum, without which a line does not count:
///   h <offset> <length> <digest>          where the header is among the entries
///   c <entry> <offset> <length> <digest>  staged and synced: from now on it will be
///   d <entry>                             its files are in their places; nothing without a 'c'
///   s                                     ... and all that stands above survives a power cut
///   p <worker> <entry>                    the same as d, for an entry of a worker that is gone
///   v <worker> <entry>                    files are missing or wrong: it never was
///   r <worker> <bytes>                    that worker's index is settled so far

/// A capture's index, or one of these.
inline constexpr int kBeginEntry = -1;
inline constexpr int kFinishEntry = -2;

/// "000017", "begin", "finish".
std::string entry_name(int entry);

struct JournalledFile {
  std::string path;  ///< Below the output folder, '/' separated.
  std::uint64_t size = 0;
  std::string digest;  ///< See digest_of().
};

/// What one transaction writes.
struct JournalledFiles {
  std::vector<JournalledFile> files;
  std::vector<std::pair<std::string, std::string>> records;  ///< Name of the writer, its line.
};

/// XXH3 (128 bits, hex): tells damaged and other files apart; no defence against forgery.
std::string digest_of(std::span<const std::byte> bytes);
std::string digest_of(std::string_view text);

/// Of a file, in little memory.
std::string digest_of(FileSystem& file_system, const std::filesystem::path& file);

/// The same, of what comes piece by piece.
class Digest {
 public:
  Digest();
  ~Digest();
  Digest(const Digest&) = delete;
  Digest& operator=(const Digest&) = delete;
  void add(std::span<const std::byte> bytes);
  std::string text() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Relative, no longer than the system takes, without `..` and the like: what may stand in a
/// journal and what writers may ask for.
bool is_plain_relative(std::string_view path);
/// In the stage of a worker that lives: stages of the work and their seconds, as JSON.
inline constexpr const char* kTimesFile = "times.json";
/// Below the folder of dataset.json: what captures keep until the dataset is finished.
inline constexpr const char* kKeptFolder = ".diorama/kept";
/// Whether a path below the output folder leads there; `records` is the folder of dataset.json.
bool is_kept_path(const std::string& records, std::string_view path);
/// Letters, digits, '.', '_' and '-', at most 200, and not led by a dot.
bool is_plain_name(std::string_view name);

/// A line of an index with its checksum and end.
std::string journal_line(std::string line);

/// Appends for one worker. Makes its files with the first line. Safe from any thread.
class JournalWriter {
 public:
  /// `records`: where dataset.json lies below the output folder.
  JournalWriter(FileSystem& file_system, std::filesystem::path folder, std::string worker,
                std::string records);

  /// Returns when it is durable.
  void commit(int entry, const JournalledFiles& files);
  void published(int entry);
  void published_for(const std::string& worker, int entry);
  /// Durable, too.
  void void_entry(const std::string& worker, int entry);
  void settled(const std::string& worker, std::uint64_t bytes);
  /// Everything published so far lies in synced folders. Durable.
  void checkpoint();
  bool has_lines() const;

 private:
  void start();
  std::string add_entry(const std::string& text);
  void add_line(std::string line);
  void append(AppendFile& file, const std::string& text);
  void sync(AppendFile& file);
  template <class Write>
  void attempt(Write write);

  FileSystem& file_system_;
  std::filesystem::path folder_;
  std::string worker_;
  std::string records_;
  mutable std::mutex mutex_;
  std::unique_ptr<AppendFile> index_;
  std::unique_ptr<AppendFile> entries_;
  std::uint64_t entries_bytes_ = 0;
  std::string failure_;  // why nothing is written any more; empty: nothing failed
};

/// Where a transaction stands among a worker's entries. Small: at the end of a run there is one in
/// memory for each capture.
struct EntryPlace {
  int entry = 0;
  std::uint32_t length = 0;
  std::uint64_t offset = 0;
  std::array<std::uint64_t, 2> digest{};  ///< The digits of digest_of().
  bool is_published = false;
};

/// One worker's index, as far as it was read.
struct WorkerIndex {
  std::uint64_t bytes_read = 0;
  std::uint64_t settled_bytes = 0;  ///< By a worker that came later.
  EntryPlace header;
  int published = 0;  ///< Captures.
  // Entries behind the last checkpoint: what a power cut may have taken. Kept apart, so that any
  // line of an index is dealt with at once, however many are open.
  std::multimap<int, EntryPlace> committed;  ///< By entry.
  std::vector<EntryPlace> published_since;

  bool has_unsettled() const { return !committed.empty() || !published_since.empty(); }
  /// In the order in which they were committed.
  std::vector<EntryPlace> unsettled() const;
};

/// Reads all workers' journals. Bad ones are Error(Output); torn lines do not count.
class Journals {
 public:
  /// `capture_count` of the whole job; entries of captures beyond it are passed over by all but
  /// visit_entries().
  Journals(FileSystem& file_system, std::filesystem::path folder, int capture_count);

  /// Reads what was appended since the last time.
  void refresh();
  /// As if nothing had been read.
  void forget();
  bool is_published(int entry) const;
  int published_captures() const { return published_captures_; }
  const std::map<std::string, WorkerIndex>& workers() const { return workers_; }

  /// Everything that is published, read anew, worker by worker.
  void visit_entries(
      const std::function<void(const std::string& worker, const EntryPlace&)>& visit) const;
  /// The published captures in their order; of one that several workers have, one after the other
  /// by name, until `visit` takes it.
  void visit_captures(
      const std::function<bool(const std::string& worker, const EntryPlace&)>& visit) const;
  /// Empty when it is torn; Error(Output) when it is whole but no journal entry.
  std::optional<JournalledFiles> files_of(const std::string& worker, const EntryPlace& place) const;
  /// Where dataset.json lies below the output folder, by the header of any worker.
  std::optional<std::string> records_folder() const;

  std::filesystem::path index_file(const std::string& worker) const;
  std::filesystem::path entries_file(const std::string& worker) const;

 private:
  using EntriesOfWorkers = std::set<std::pair<std::string, int>>;
  struct Line;
  static std::optional<Line> parse(std::string_view text);
  std::vector<std::string> worker_names() const;
  std::vector<EntryPlace> entries_of(const std::string& worker) const;
  void read_worker(const std::string& worker);
  void read_workers();
  void take(const std::string& worker, WorkerIndex& index, const Line& line);
  bool set_published(const std::string& worker, int entry, WorkerIndex& index);

  FileSystem& file_system_;
  std::filesystem::path folder_;
  int capture_count_;
  std::map<std::string, WorkerIndex> workers_;
  EntriesOfWorkers voids_;
  EntriesOfWorkers published_for_;  ///< Whose own lines have not been read yet.
  bool has_new_voids_ = false;
  std::vector<bool> published_;
  bool has_begun_ = false;
  bool has_finished_ = false;
  int published_captures_ = 0;
};

}  // namespace diorama
