// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "framework/output/file_system.h"

namespace diorama::test {

/// Thrown into a simulated process by every call after its death.
class Killed final : public std::exception {};

/// A disk in memory that several simulated processes share. It keeps apart what is there and what
/// would survive a power cut: contents of files after sync(), names after sync_folder(). All calls
/// are steps of one order, which a seeded scheduler draws when processes run beside each other.
class SimulatedDisk {
 public:
  explicit SimulatedDisk(std::uint64_t seed) : random_(seed) {}

  /// Everything below a folder, by path.
  std::map<std::string, std::string> tree(const std::filesystem::path& root) const;
  void put(const std::filesystem::path& file, const std::string& content);
  void erase(const std::filesystem::path& file);

  /// What was not synced is lost, each name and each content by chance; locks are gone.
  void cut_power();
  /// Seconds that pass between two steps.
  void set_step_time(double seconds) { step_ns_ = std::int64_t(seconds * 1e9); }
  void wait(double seconds) { now_ns_ += std::int64_t(seconds * 1e9); }

  /// Runs the processes to their ends, one step at a time, in an order drawn from the seed.
  void run(const std::vector<std::function<void()>>& processes);

 private:
  friend class SimulatedProcess;
  struct Content {
    std::string now;
    std::string synced;
    std::int64_t modified_ns = 0;
    const void* lock_holder = nullptr;
  };
  struct Node {
    std::shared_ptr<Content> content;  ///< Null for folders.
  };
  using Names = std::map<std::string, Node>;

  void take_turn(std::unique_lock<std::mutex>& lock);
  void pick_next();

  mutable std::mutex mutex_;
  std::condition_variable turn_changed_;
  std::mt19937_64 random_;
  Names now_;     ///< By full path.
  Names synced_;  ///< What a power cut leaves.
  std::int64_t now_ns_ = 1;
  std::int64_t step_ns_ = 2'000'000;

  bool is_scheduling_ = false;
  std::set<int> runnable_;
  int turn_ = -1;
};

/// One process on the disk; may be killed at its n-th step. Each has a machine of its own or
/// shares one with others, as its identity says.
class SimulatedProcess : public FileSystem {
 public:
  explicit SimulatedProcess(SimulatedDisk& disk) : disk_(disk) {}
  /// Releases its locks, as the kernel does.
  ~SimulatedProcess() override;

  /// The step (from 1) in which it dies; that step may happen half. 0: never.
  void kill_at(int step) { kill_at_ = step; }
  /// A step that fails instead, once; later ones work.
  void fail_at(int step) { fail_at_ = step; }
  /// File systems without locks.
  void set_locks(bool works) { has_locks_ = works; }
  int steps() const { return steps_; }
  bool is_dead() const { return is_dead_; }
  /// Steps by kind: "write", "sync" ...
  const std::map<std::string, int>& counts() const { return counts_; }

  std::vector<std::filesystem::path> make_folders(const std::filesystem::path& folder) override;
  void write(const std::filesystem::path& file, std::span<const std::byte> bytes) override;
  void sync(const std::filesystem::path& file) override;
  void sync_folder(const std::filesystem::path& folder) override;
  bool move_new(const std::filesystem::path& from, const std::filesystem::path& to) override;
  bool remove_file(const std::filesystem::path& file) override;
  void remove_if_empty(const std::filesystem::path& folder) override;
  bool touch(const std::filesystem::path& file) override;
  std::unique_ptr<AppendFile> append_to(const std::filesystem::path& file) override;
  std::optional<FileStatus> status(const std::filesystem::path& path) override;
  std::string read(const std::filesystem::path& file) override;
  std::string read_part(const std::filesystem::path& file, std::uint64_t offset,
                        std::uint64_t length) override;
  std::vector<std::string> list(const std::filesystem::path& folder) override;
  std::unique_ptr<FileLock> lock(const std::filesystem::path& file) override;
  bool is_locked(const std::filesystem::path& file) override;

 private:
  class Append;
  class Lock;
  using Change = std::function<void(bool is_half)>;
  void act(const char* kind, const Change& change);
  std::shared_ptr<SimulatedDisk::Content> file(const std::filesystem::path& path) const;
  void require_parent(const std::filesystem::path& path) const;
  void append(const std::shared_ptr<SimulatedDisk::Content>& content, std::string_view text);

  SimulatedDisk& disk_;
  int steps_ = 0;
  int kill_at_ = 0;
  int fail_at_ = 0;
  bool has_locks_ = true;
  bool is_dead_ = false;
  std::map<std::string, int> counts_;
};

}  // namespace diorama::test
