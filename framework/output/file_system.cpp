// SPDX-License-Identifier: Apache-2.0
#include "framework/output/file_system.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <string_view>
#include <system_error>
#include <utility>

namespace diorama {
namespace {

namespace fs = std::filesystem;

bool is_gone(int error_number) { return error_number == ENOENT || error_number == ENOTDIR; }

[[noreturn]] void fail(const std::string& what, const fs::path& path, int error_number) {
  const std::error_code code(error_number, std::generic_category());
  const std::string text = what + " " + path.string() + ": " + code.message();
  if (error_number == ENOENT) throw NotThere(ErrorKind::Output, text);
  throw Error(ErrorKind::Output, text);
}

/// Closes on every way out; close() itself may report what write() did not.
class OpenFile {
 public:
  OpenFile(const fs::path& file, int flags, const char* what)
      : file_(file), handle_(open_again(file, flags | O_CLOEXEC)) {
    if (handle_ < 0) fail(what, file_, errno);
  }
  /// Null when there is no such file: others remove theirs at any time, also between two looks.
  static std::unique_ptr<OpenFile> if_there(const fs::path& file, int flags, const char* what) {
    const int handle = open_again(file, flags | O_CLOEXEC);
    if (handle < 0 && is_gone(errno)) return nullptr;
    if (handle < 0) fail(what, file, errno);
    return std::unique_ptr<OpenFile>(new OpenFile(file, handle));
  }
  ~OpenFile() {
    if (handle_ >= 0) ::close(handle_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  int handle() const { return handle_; }

  void write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(handle_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail("cannot write", file_, written < 0 ? errno : EIO);
      bytes = bytes.subspan(std::size_t(written));
    }
  }
  std::string read(std::uint64_t offset, std::uint64_t length) {
    std::string text;
    char block[1 << 16];
    while (length > 0) {
      const std::size_t wanted = std::size_t(std::min<std::uint64_t>(length, sizeof block));
      const ssize_t got = ::pread(handle_, block, wanted, off_t(offset));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) fail("cannot read", file_, errno);
      if (got == 0) break;
      text.append(block, std::size_t(got));
      offset += std::uint64_t(got);
      length -= std::uint64_t(got);
    }
    return text;
  }
  /// File systems without this (some in user space) have nothing to lose by it.
  void sync() {
    if (::fsync(handle_) != 0 && errno != EINVAL && errno != ENOTSUP) {
      fail("cannot write", file_, errno);
    }
  }
  void close() {
    const int handle = std::exchange(handle_, -1);
    if (::close(handle) != 0) fail("cannot write", file_, errno);
  }

 private:
  OpenFile(fs::path file, int handle) : file_(std::move(file)), handle_(handle) {}
  static int open_again(const fs::path& file, int flags) {
    int handle = -1;
    do {
      handle = ::open(file.c_str(), flags, 0666);
    } while (handle < 0 && errno == EINTR);
    return handle;
  }
  fs::path file_;
  int handle_;
};

class LocalAppendFile final : public AppendFile {
 public:
  explicit LocalAppendFile(const fs::path& file)
      : file_(file, O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW, "cannot create") {}
  void append(std::span<const std::byte> bytes) override { file_.write(bytes); }
  void sync() override { file_.sync(); }

 private:
  OpenFile file_;
};

/// A lock of the open file, not of the process: several stores in one process exclude each other.
struct flock whole_file() {
  struct flock whole {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  return whole;
}

class LocalLock final : public FileLock {
 public:
  explicit LocalLock(const fs::path& file) : file_(file, O_RDWR | O_NOFOLLOW, "cannot lock") {}
  bool take() {
    struct flock whole = whole_file();
    return ::fcntl(file_.handle(), F_OFD_SETLK, &whole) == 0;
  }

 private:
  OpenFile file_;
};

/// For file systems that cannot rename without replacing.
bool move_by_link(const fs::path& from, const fs::path& to) {
  if (::link(from.c_str(), to.c_str()) == 0) {
    if (::unlink(from.c_str()) != 0) fail("cannot remove", from, errno);
    return true;
  }
  if (errno == EEXIST) return false;
  if (errno != EPERM && errno != ENOTSUP && errno != EMLINK && errno != ENOSYS) {
    fail("cannot move a finished file to", to, errno);
  }
  struct stat status {};
  if (::lstat(to.c_str(), &status) == 0) return false;
  if (::rename(from.c_str(), to.c_str()) != 0) {
    fail("cannot move a finished file to", to, errno);
  }
  return true;
}

}  // namespace

AppendFile::~AppendFile() = default;
FileLock::~FileLock() = default;
FileSystem::~FileSystem() = default;

std::vector<fs::path> LocalFileSystem::make_folders(const fs::path& folder) {
  // Others may remove an empty parent between two steps; who keeps doing so is a fault.
  constexpr int kAttempts = 100;
  for (int attempt = 0;; ++attempt) {
    std::vector<fs::path> created;
    std::vector<fs::path> missing;
    fs::path place = folder;
    while (!place.empty()) {
      struct stat status {};
      if (::stat(place.c_str(), &status) == 0) {
        if (!S_ISDIR(status.st_mode)) fail("cannot create the folder", folder, ENOTDIR);
        break;
      }
      if (errno != ENOENT) fail("cannot create the folder", folder, errno);
      missing.push_back(place);
      if (!place.has_relative_path()) break;
      place = place.parent_path();
    }
    int error_number = 0;
    for (auto next = missing.rbegin(); next != missing.rend() && error_number == 0; ++next) {
      if (::mkdir(next->c_str(), 0777) == 0) {
        created.push_back(*next);
      } else if (errno != EEXIST) {
        error_number = errno;
      }
    }
    if (error_number == 0) return created;
    if (error_number != ENOENT || attempt == kAttempts) {
      fail("cannot create the folder", folder, error_number);
    }
  }
}

void LocalFileSystem::write(const fs::path& file, std::span<const std::byte> bytes) {
  OpenFile open_file(file, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW, "cannot create");
  open_file.write(bytes);
  open_file.close();
}

void LocalFileSystem::sync(const fs::path& file) {
  OpenFile(file, O_RDONLY | O_NOFOLLOW, "cannot write").sync();
}

void LocalFileSystem::sync_folder(const fs::path& folder) {
  const int handle = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0 && is_gone(errno)) return;
  if (handle < 0) fail("cannot open the folder", folder, errno);
  const int error_number = ::fsync(handle) == 0 ? 0 : errno;
  ::close(handle);
  if (error_number != 0 && error_number != EINVAL && error_number != ENOTSUP) {
    fail("cannot write the folder", folder, error_number);
  }
}

bool LocalFileSystem::move_new(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return true;
  if (errno == EEXIST) return false;
  if (errno == EINVAL || errno == ENOSYS || errno == ENOTSUP) return move_by_link(from, to);
  fail("cannot move a finished file to", to, errno);
}

bool LocalFileSystem::remove_file(const fs::path& file) {
  if (::unlink(file.c_str()) == 0) return true;
  if (is_gone(errno)) return false;
  fail("cannot remove", file, errno);
}

void LocalFileSystem::remove_if_empty(const fs::path& folder) {
  if (::rmdir(folder.c_str()) == 0) return;
  // Somebody's current folder may not be removed on some file systems.
  if (!is_gone(errno) && errno != ENOTEMPTY && errno != EEXIST && errno != EBUSY) {
    fail("cannot remove", folder, errno);
  }
}

bool LocalFileSystem::touch(const fs::path& file) {
  if (::utimensat(AT_FDCWD, file.c_str(), nullptr, AT_SYMLINK_NOFOLLOW) == 0) return true;
  if (is_gone(errno)) return false;
  fail("cannot write", file, errno);
}

std::unique_ptr<AppendFile> LocalFileSystem::append_to(const fs::path& file) {
  return std::make_unique<LocalAppendFile>(file);
}

std::optional<FileStatus> LocalFileSystem::status(const fs::path& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) {
    if (is_gone(errno)) return std::nullopt;
    fail("cannot look at", path, errno);
  }
  FileStatus found;
  found.kind = S_ISREG(status.st_mode)   ? FileStatus::Kind::File
               : S_ISDIR(status.st_mode) ? FileStatus::Kind::Folder
               : S_ISLNK(status.st_mode) ? FileStatus::Kind::Link
                                         : FileStatus::Kind::Other;
  found.size = std::uint64_t(status.st_size);
  found.modified_ns =
      std::int64_t(status.st_mtim.tv_sec) * 1'000'000'000 + std::int64_t(status.st_mtim.tv_nsec);
  return found;
}

std::string LocalFileSystem::read(const fs::path& file) {
  OpenFile open_file(file, O_RDONLY | O_NONBLOCK, "cannot read");
  struct stat status {};
  if (::fstat(open_file.handle(), &status) != 0) fail("cannot read", file, errno);
  if (!S_ISREG(status.st_mode)) {
    throw Error(ErrorKind::Output, "cannot read " + file.string() + ": it is no regular file");
  }
  if (std::uint64_t(status.st_size) > kMostReadBytes) {
    throw Error(ErrorKind::Output, "cannot read " + file.string() + ": it has " +
                                       std::to_string(status.st_size) + " bytes, more than the " +
                                       std::to_string(kMostReadBytes) + " that are read at once");
  }
  return open_file.read(0, kMostReadBytes);
}

std::string LocalFileSystem::read_part(const fs::path& file, std::uint64_t offset,
                                       std::uint64_t length) {
  const auto found = status(file);
  if (!found || found->kind != FileStatus::Kind::File || found->size <= offset) return {};
  const auto open = OpenFile::if_there(file, O_RDONLY | O_NOFOLLOW, "cannot read");
  return open ? open->read(offset, length) : std::string();
}

std::vector<std::string> LocalFileSystem::list(const fs::path& folder) {
  DIR* const open_folder = ::opendir(folder.c_str());
  if (!open_folder) {
    if (is_gone(errno)) return {};
    fail("cannot list", folder, errno);
  }
  std::vector<std::string> names;
  errno = 0;
  while (const dirent* entry = ::readdir(open_folder)) {
    const std::string_view name = entry->d_name;
    if (name != "." && name != "..") names.emplace_back(name);
  }
  const int error_number = errno;
  ::closedir(open_folder);
  if (error_number != 0) fail("cannot list", folder, error_number);
  std::sort(names.begin(), names.end());
  return names;
}

std::unique_ptr<FileLock> LocalFileSystem::lock(const fs::path& file) {
  auto lock = std::make_unique<LocalLock>(file);
  if (!lock->take()) return nullptr;
  return lock;
}

bool LocalFileSystem::is_locked(const fs::path& file) {
  const auto found = status(file);
  if (!found || found->kind != FileStatus::Kind::File) return false;
  const auto open = OpenFile::if_there(file, O_RDWR | O_NOFOLLOW, "cannot lock");
  struct flock whole = whole_file();
  return open && ::fcntl(open->handle(), F_OFD_GETLK, &whole) == 0 && whole.l_type != F_UNLCK;
}

void require_writable(FileSystem& file_system, const fs::path& folder, const std::string& name) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  fs::path existing = whole;
  while (!file_system.exists(existing) && existing.has_relative_path()) {
    existing = existing.parent_path();
  }
  if (existing.filename().empty() && existing.has_parent_path()) existing = existing.parent_path();
  const fs::path trial = existing / (".diorama-write-test-" + name);
  try {
    file_system.make_folders(trial);
  } catch (const Error& error) {
    // Nobody asked for the trial: the message is about the folder that was asked for.
    const std::string text = error.what();
    const std::size_t at = text.find(trial.string());
    if (at == text.npos) throw;
    throw Error(error.kind(), (existing == whole ? "cannot write into the folder "
                                                 : "cannot create the folder ") +
                                  folder.string() + text.substr(at + trial.string().size()));
  }
  file_system.remove_if_empty(trial);
}

}  // namespace diorama
