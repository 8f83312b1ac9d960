// SPDX-License-Identifier: Apache-2.0
#include "framework/host/scratch_folder.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr off_t kLeastSpace = 1 << 20;

fs::path temporary_files() {
  const char* chosen = std::getenv("TMPDIR");
  return chosen != nullptr && *chosen != '\0' ? fs::absolute(chosen) : fs::path("/tmp");
}

/// 0, or what keeps small files out of a folder: a disk can be full and still take a new folder.
int space_fault(const fs::path& folder) {
  const fs::path file = folder / "space";
  const int opened = open(file.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600);
  if (opened < 0) return errno;
  const int fault = posix_fallocate(opened, 0, kLeastSpace);
  close(opened);
  unlink(file.c_str());
  return fault;
}

}  // namespace

ScratchFolder::ScratchFolder(const std::string& purpose) {
  const fs::path parent = temporary_files();
  std::string pattern = (parent / ("diorama_" + purpose + "_XXXXXX")).string();
  int fault = mkdtemp(pattern.data()) == nullptr ? errno : 0;
  if (fault == 0) {
    path_ = pattern;
    fault = space_fault(path_);
    std::error_code ignored;
    if (fault != 0) fs::remove_all(path_, ignored);
  }
  if (fault == 0) return;
  throw Error(ErrorKind::Output, parent.string() + ": cannot hold temporary files: " +
                                     std::system_category().message(fault) +
                                     "; set TMPDIR to a folder with space that you may write");
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace diorama
