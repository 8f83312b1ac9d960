// SPDX-License-Identifier: Apache-2.0
// Loaded before the C library (LD_PRELOAD): write() fails once so many bytes have gone to files
// below a folder. Stands for full disks and quotas where a test may not mount any.
//   DIORAMA_TEST_FAIL_BELOW  the folder
//   DIORAMA_TEST_FAIL_AFTER  bytes that still fit
//   DIORAMA_TEST_FAIL_WITH   errno to fail with
#include <dlfcn.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <string>
#include <string_view>

namespace {

using Write = ssize_t (*)(int, const void*, size_t);

std::atomic<long long> written = 0;

bool is_below(int handle, std::string_view folder) {
  char path[4096];
  const std::string link = "/proc/self/fd/" + std::to_string(handle);
  const ssize_t size = ::readlink(link.c_str(), path, sizeof path);
  return size > 0 && std::string_view(path, std::size_t(size)).starts_with(folder);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) ssize_t write(int handle, const void* data,
                                                                size_t size) {
  static const auto real = reinterpret_cast<Write>(::dlsym(RTLD_NEXT, "write"));
  const char* folder = std::getenv("DIORAMA_TEST_FAIL_BELOW");
  if (folder == nullptr || !is_below(handle, folder)) return real(handle, data, size);
  const long long before = written.fetch_add(static_cast<long long>(size));
  const long long room = std::atoll(std::getenv("DIORAMA_TEST_FAIL_AFTER")) - before;
  if (room <= 0) {
    errno = std::atoi(std::getenv("DIORAMA_TEST_FAIL_WITH"));
    return -1;
  }
  // As a disk does: what fits is written, the rest fails at the next call.
  return real(handle, data, room < static_cast<long long>(size) ? std::size_t(room) : size);
}
