// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/file_system.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& what, const fs::path& path, const std::error_code& code) {
  throw Error(ErrorKind::Output, what + " " + path.string() + ": " + code.message());
}

[[noreturn]] void fail(const std::string& what, const fs::path& path, int error_number) {
  fail(what, path, std::error_code(error_number, std::generic_category()));
}

/// Closes on every way out; close() itself may report what write() did not.
class OpenFile {
 public:
  /// `how`: O_CREAT | O_TRUNC, or O_APPEND.
  OpenFile(const fs::path& file, int how)
      : file_(file), handle_(::open(file.c_str(), O_WRONLY | O_CLOEXEC | how, 0666)) {
    if (handle_ < 0) fail("cannot create", file_, errno);
  }
  ~OpenFile() {
    if (handle_ >= 0) ::close(handle_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  void write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(handle_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail("cannot write", file_, written < 0 ? errno : EIO);
      bytes = bytes.subspan(std::size_t(written));
    }
  }
  void close() {
    const int handle = std::exchange(handle_, -1);
    if (::close(handle) != 0) fail("cannot write", file_, errno);
  }

 private:
  const fs::path& file_;
  int handle_;
};

}  // namespace

FileSystem::~FileSystem() = default;

void LocalFileSystem::make_folders(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (code) fail("cannot create the folder", folder, code);
}

void LocalFileSystem::write(const fs::path& file, std::span<const std::byte> bytes) {
  OpenFile open_file(file, O_CREAT | O_TRUNC);
  open_file.write(bytes);
  open_file.close();
}

void LocalFileSystem::append(const fs::path& file, std::span<const std::byte> bytes) {
  OpenFile open_file(file, O_APPEND);
  open_file.write(bytes);
  open_file.close();
}

void LocalFileSystem::rename(const fs::path& from, const fs::path& to) {
  std::error_code code;
  fs::rename(from, to, code);
  if (code) fail("cannot move a finished file to", to, code);
}

void LocalFileSystem::remove(const fs::path& path) {
  std::error_code code;
  fs::remove_all(path, code);
  if (code) fail("cannot remove", path, code);
}

void LocalFileSystem::remove_if_empty(const fs::path& folder) {
  if (::rmdir(folder.c_str()) == 0) return;
  if (errno != ENOENT && errno != ENOTEMPTY && errno != EEXIST && errno != ENOTDIR) {
    fail("cannot remove", folder, errno);
  }
}

bool LocalFileSystem::exists(const fs::path& path) {
  std::error_code code;
  return fs::exists(fs::symlink_status(path, code));
}

std::string LocalFileSystem::read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) fail("cannot read", file, errno);
  std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (stream.bad()) fail("cannot read", file, EIO);
  return text;
}

std::vector<std::string> LocalFileSystem::list(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code code;
  if (!fs::exists(folder, code)) return names;
  for (const auto& entry : fs::directory_iterator(folder, code)) {
    names.push_back(entry.path().filename().string());
  }
  if (code) fail("cannot list", folder, code);
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace diorama
