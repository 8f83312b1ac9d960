// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "framework/output/file_system.h"

namespace diorama {

/// Files that end with the object, for runs that leave nothing on the disk. One process; everything
/// below one root folder that is always there.
class MemoryFileSystem final : public FileSystem {
 public:
  std::vector<std::filesystem::path> make_folders(const std::filesystem::path& folder) override;
  void write(const std::filesystem::path& file, std::span<const std::byte> bytes) override;
  void sync(const std::filesystem::path&) override {}
  void sync_folder(const std::filesystem::path&) override {}
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
  class Appender;
  class Held;
  struct File {
    std::string content;
    std::int64_t modified_ns = 0;
    std::weak_ptr<void> lock;  ///< Its holder's.
  };
  File& file_at(const std::filesystem::path& file);
  void require_parent(const std::filesystem::path& path) const;
  bool has_entries(const std::filesystem::path& folder) const;

  std::mutex mutex_;
  std::map<std::filesystem::path, File> files_;
  std::set<std::filesystem::path> folders_;
};

}  // namespace diorama
