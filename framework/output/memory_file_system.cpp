// SPDX-License-Identifier: Apache-2.0
#include "framework/output/memory_file_system.h"

#include <algorithm>
#include <chrono>

namespace diorama {
namespace {

namespace fs = std::filesystem;

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

[[noreturn]] void refuse_absent(const fs::path& path) {
  throw NotThere(ErrorKind::Output, path.string() + ": No such file or directory");
}

}  // namespace

class MemoryFileSystem::Appender final : public AppendFile {
 public:
  Appender(MemoryFileSystem& system, fs::path file) : system_(system), file_(std::move(file)) {}
  void append(std::span<const std::byte> bytes) override {
    const std::lock_guard lock(system_.mutex_);
    File& file = system_.file_at(file_);
    file.content += text_of(bytes);
    file.modified_ns = now_ns();
  }
  void sync() override {}

 private:
  MemoryFileSystem& system_;
  fs::path file_;
};

/// Of the file, whatever its name becomes.
class MemoryFileSystem::Held final : public FileLock {
 public:
  explicit Held(std::shared_ptr<void> lock) : lock_(std::move(lock)) {}

 private:
  std::shared_ptr<void> lock_;
};

MemoryFileSystem::File& MemoryFileSystem::file_at(const fs::path& file) {
  const auto found = files_.find(file);
  if (found == files_.end()) refuse_absent(file);
  return found->second;
}

void MemoryFileSystem::require_parent(const fs::path& path) const {
  const fs::path parent = path.parent_path();
  if (parent != parent.parent_path() && !folders_.contains(parent)) refuse_absent(path);
}

bool MemoryFileSystem::has_entries(const fs::path& folder) const {
  const auto is_inside = [&](const fs::path& path) { return path.parent_path() == folder; };
  return std::any_of(folders_.begin(), folders_.end(), is_inside) ||
         std::any_of(files_.begin(), files_.end(),
                     [&](const auto& entry) { return is_inside(entry.first); });
}

std::vector<fs::path> MemoryFileSystem::make_folders(const fs::path& folder) {
  const std::lock_guard lock(mutex_);
  std::vector<fs::path> created;
  for (fs::path at = folder; at != at.parent_path() && !folders_.contains(at);
       at = at.parent_path()) {
    if (files_.contains(at)) {
      throw Error(ErrorKind::Output, "cannot create the folder " + folder.string());
    }
    created.push_back(at);
  }
  std::reverse(created.begin(), created.end());
  folders_.insert(created.begin(), created.end());
  return created;
}

void MemoryFileSystem::write(const fs::path& file, std::span<const std::byte> bytes) {
  const std::lock_guard lock(mutex_);
  require_parent(file);
  File& written = files_[file];
  written.content = text_of(bytes);
  written.modified_ns = now_ns();
}

bool MemoryFileSystem::move_new(const fs::path& from, const fs::path& to) {
  const std::lock_guard lock(mutex_);
  file_at(from);
  require_parent(to);
  if (files_.contains(to) || folders_.contains(to)) return false;
  auto node = files_.extract(from);
  node.key() = to;
  files_.insert(std::move(node));
  return true;
}

bool MemoryFileSystem::remove_file(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  return files_.erase(file) > 0;
}

void MemoryFileSystem::remove_if_empty(const fs::path& folder) {
  const std::lock_guard lock(mutex_);
  if (!has_entries(folder)) folders_.erase(folder);
}

bool MemoryFileSystem::touch(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(file);
  if (found == files_.end()) return false;
  found->second.modified_ns = now_ns();
  return true;
}

std::unique_ptr<AppendFile> MemoryFileSystem::append_to(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  require_parent(file);
  files_[file].modified_ns = now_ns();
  return std::make_unique<Appender>(*this, file);
}

std::optional<FileStatus> MemoryFileSystem::status(const fs::path& path) {
  const std::lock_guard lock(mutex_);
  if (folders_.contains(path) || path == path.parent_path()) {
    return FileStatus{FileStatus::Kind::Folder, 0, 0};
  }
  const auto found = files_.find(path);
  if (found == files_.end()) return std::nullopt;
  return FileStatus{FileStatus::Kind::File, found->second.content.size(),
                    found->second.modified_ns};
}

std::string MemoryFileSystem::read(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  return file_at(file).content;
}

std::string MemoryFileSystem::read_part(const fs::path& file, std::uint64_t offset,
                                        std::uint64_t length) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(file);
  if (found == files_.end() || offset >= found->second.content.size()) return {};
  return found->second.content.substr(offset, length);
}

std::vector<std::string> MemoryFileSystem::list(const fs::path& folder) {
  const std::lock_guard lock(mutex_);
  std::set<std::string> names;
  for (const fs::path& other : folders_) {
    if (other.parent_path() == folder) names.insert(other.filename().string());
  }
  for (const auto& [file, content] : files_) {
    if (file.parent_path() == folder) names.insert(file.filename().string());
  }
  return {names.begin(), names.end()};
}

std::unique_ptr<FileLock> MemoryFileSystem::lock(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  File& locked = file_at(file);
  if (!locked.lock.expired()) return nullptr;
  const auto held = std::make_shared<char>();
  locked.lock = held;
  return std::make_unique<Held>(held);
}

bool MemoryFileSystem::is_locked(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(file);
  return found != files_.end() && !found->second.lock.expired();
}

}  // namespace diorama
