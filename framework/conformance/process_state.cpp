// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/process_state.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cfenv>
#include <clocale>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <system_error>

#include "framework/conformance/check_run.h"

namespace diorama::conformance {
namespace {

mode_t current_mask() {
  const mode_t mask = umask(0);
  umask(mask);
  return mask;
}

bool keeps_tiny_numbers() {
  const volatile double least = std::numeric_limits<double>::min();
  return least / 2.0 != 0.0;
}

std::map<std::string, std::string> current_environment() {
  std::map<std::string, std::string> variables;
  for (char** entry = environ; entry && *entry; ++entry) {
    const char* const equals = std::strchr(*entry, '=');
    if (equals) variables[std::string(*entry, std::size_t(equals - *entry))] = equals + 1;
  }
  return variables;
}

/// Output may go to a file, and drivers keep such a stream once more for their log.
bool is_standard_stream(const struct stat& file) {
  for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    struct stat stream {};
    if (::fstat(number, &stream) == 0 && stream.st_dev == file.st_dev &&
        stream.st_ino == file.st_ino) {
      return true;
    }
  }
  return false;
}

/// Names of the files that are open. What drivers and libraries hold (devices, sockets, caches of
/// kernels) is theirs.
std::multiset<std::string> current_files() {
  std::multiset<std::string> names;
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", gone)) {
    struct stat status {};
    const int number = std::atoi(entry.path().filename().c_str());
    if (::fstat(number, &status) != 0 || !S_ISREG(status.st_mode)) continue;
    if (is_standard_stream(status)) continue;
    names.insert(std::filesystem::read_symlink(entry.path(), gone).string());
  }
  return names;
}

}  // namespace

ProcessState::ProcessState() {
  std::error_code gone;
  folder_ = std::filesystem::current_path(gone).string();
  mask_ = current_mask();
  locale_ = std::setlocale(LC_ALL, nullptr);
  rounding_ = std::fegetround();
  keeps_tiny_numbers_ = keeps_tiny_numbers();
  environment_ = current_environment();
  files_ = current_files();
  ::pthread_sigmask(SIG_BLOCK, nullptr, &blocked_);
  for (int number = 1; number < NSIG; ++number) {
    struct sigaction action {};
    if (sigaction(number, nullptr, &action) == 0)
      handlers_[std::size_t(number)] = action.sa_handler;
  }
}

void ProcessState::require_unchanged() const {
  const ProcessState now;
  require(now.folder_ == folder_, "changes the working folder to " + now.folder_);
  require(now.mask_ == mask_, "changes the mask of new files' rights");
  require(now.locale_ == locale_, "changes the locale to " + now.locale_);
  require(now.rounding_ == rounding_, "changes how floating-point numbers are rounded");
  require(now.keeps_tiny_numbers_ == keeps_tiny_numbers_, "makes tiny numbers zero");
  require(now.environment_ == environment_, "changes environment variables");
  for (const std::string& name : now.files_) {
    require(now.files_.count(name) <= files_.count(name), "leaves '" + name + "' open");
  }
  for (std::size_t number = 1; number < NSIG; ++number) {
    require(::sigismember(&now.blocked_, int(number)) == ::sigismember(&blocked_, int(number)),
            "blocks signal " + std::to_string(number));
    require(now.handlers_[number] == handlers_[number],
            "changes what signal " + std::to_string(number) + " does");
  }
}

}  // namespace diorama::conformance
