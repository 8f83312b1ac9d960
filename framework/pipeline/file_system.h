// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace diorama {

/// What the output store does to the disk; an interface so that tests can make any step fail. Every
/// function throws Error(Output) naming the path and the system's reason. Safe from any thread.
class FileSystem {
 public:
  virtual ~FileSystem();

  /// With all missing parents.
  virtual void make_folders(const std::filesystem::path& folder) = 0;
  /// Creates or replaces a file.
  virtual void write(const std::filesystem::path& file, std::span<const std::byte> bytes) = 0;
  /// Puts bytes at the end of a file that is there.
  virtual void append(const std::filesystem::path& file, std::span<const std::byte> bytes) = 0;
  /// Replaces `to` atomically.
  virtual void rename(const std::filesystem::path& from, const std::filesystem::path& to) = 0;
  /// A file, or a folder with all that is in it; nothing happens when it is not there.
  virtual void remove(const std::filesystem::path& path) = 0;
  /// Removes a folder if it is there and empty.
  virtual void remove_if_empty(const std::filesystem::path& folder) = 0;

  virtual bool exists(const std::filesystem::path& path) = 0;
  virtual std::string read(const std::filesystem::path& file) = 0;
  /// Names of the entries, sorted; empty when the folder is not there.
  virtual std::vector<std::string> list(const std::filesystem::path& folder) = 0;
};

/// The machine's own.
class LocalFileSystem final : public FileSystem {
 public:
  void make_folders(const std::filesystem::path& folder) override;
  void write(const std::filesystem::path& file, std::span<const std::byte> bytes) override;
  void append(const std::filesystem::path& file, std::span<const std::byte> bytes) override;
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override;
  void remove(const std::filesystem::path& path) override;
  void remove_if_empty(const std::filesystem::path& folder) override;
  bool exists(const std::filesystem::path& path) override;
  std::string read(const std::filesystem::path& file) override;
  std::vector<std::string> list(const std::filesystem::path& folder) override;
};

}  // namespace diorama
