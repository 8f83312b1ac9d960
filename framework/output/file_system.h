// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diorama/error.h"

namespace diorama {

/// What a path names; links are not followed.
struct FileStatus {
  enum class Kind : std::uint8_t { File, Folder, Link, Other };
  Kind kind = Kind::File;
  std::uint64_t size = 0;
  std::int64_t modified_ns = 0;  ///< By the clock of the file system, which may be a server's.
};

/// What read() takes: far more than any description of a dataset has.
inline constexpr std::uint64_t kMostReadBytes = std::uint64_t(1) << 30;

/// A file that one process appends to.
class AppendFile {
 public:
  virtual ~AppendFile();
  virtual void append(std::span<const std::byte> bytes) = 0;
  /// Returns when all that was appended survives a power cut.
  virtual void sync() = 0;
};

/// Held by a process until it ends or destroys this.
class FileLock {
 public:
  virtual ~FileLock();
};

/// A file or its folder is not there, or not any more.
class NotThere final : public Error {
 public:
  using Error::Error;
};

/// What the output store does to the disk; an interface so that tests can make any step fail, lose
/// what was not synced, and run many processes on one disk. Every function throws Error(Output)
/// naming the path and the system's reason. Safe from any thread.
class FileSystem {
 public:
  virtual ~FileSystem();

  /// With all missing parents; returns those that it created, outermost first. Folders that others
  /// remove meanwhile are made again.
  virtual std::vector<std::filesystem::path> make_folders(const std::filesystem::path& folder) = 0;
  /// Creates or replaces a file.
  virtual void write(const std::filesystem::path& file, std::span<const std::byte> bytes) = 0;
  /// Returns when the file's content survives a power cut; its name may need sync_folder().
  virtual void sync(const std::filesystem::path& file) = 0;
  /// Returns when the names in a folder survive a power cut. Nothing happens where it is not there.
  virtual void sync_folder(const std::filesystem::path& folder) = 0;
  /// Gives a file another name, atomically. False, and nothing happens, when `to` exists.
  virtual bool move_new(const std::filesystem::path& from, const std::filesystem::path& to) = 0;
  /// Removes a file or a link; false when it is not there. Folders are an error.
  virtual bool remove_file(const std::filesystem::path& file) = 0;
  /// Removes a folder if it is there and empty.
  virtual void remove_if_empty(const std::filesystem::path& folder) = 0;
  /// Sets the time of the last change to now, by the file system's clock. False when it is gone.
  virtual bool touch(const std::filesystem::path& file) = 0;
  virtual std::unique_ptr<AppendFile> append_to(const std::filesystem::path& file) = 0;

  /// Empty when there is nothing, or a parent is missing.
  virtual std::optional<FileStatus> status(const std::filesystem::path& path) = 0;
  /// All of a regular file of at most kMostReadBytes: what a stranger sent may have no end.
  virtual std::string read(const std::filesystem::path& file) = 0;
  /// Fewer bytes where the file ends; empty when it is not there.
  virtual std::string read_part(const std::filesystem::path& file, std::uint64_t offset,
                                std::uint64_t length) = 0;
  /// Names of the entries, sorted; empty when the folder is not there.
  virtual std::vector<std::string> list(const std::filesystem::path& folder) = 0;

  /// Locks an existing file; null when another holder has it, or the file system has no locks.
  virtual std::unique_ptr<FileLock> lock(const std::filesystem::path& file) = 0;
  /// Whether anybody holds the lock. False where the file system has no locks.
  virtual bool is_locked(const std::filesystem::path& file) = 0;

  bool exists(const std::filesystem::path& path) { return status(path).has_value(); }
};

/// Makes something in a folder that other processes may remove while it is empty, and make again.
/// What `action` needs elsewhere and others may remove, it makes itself.
template <class Action>
auto in_folder(FileSystem& file_system, const std::filesystem::path& folder, Action action) {
  constexpr int kAttempts = 100;
  for (int attempt = 1;; ++attempt) {
    file_system.make_folders(folder);
    try {
      return action();
    } catch (const NotThere&) {
      if (attempt == kAttempts) throw;
    }
  }
}

/// The machine's own.
class LocalFileSystem final : public FileSystem {
 public:
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
};

/// Throws Error(Output) that names `folder` unless it, or what is missing of its path, can be made
/// and written. What is there stays as it is; `name` tells trials of several processes apart.
void require_writable(FileSystem& file_system, const std::filesystem::path& folder,
                      const std::string& name);

}  // namespace diorama
