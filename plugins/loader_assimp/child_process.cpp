// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/child_process.h"

#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <exception>
#include <fstream>
#include <optional>

namespace diorama::loader_assimp {
namespace {

void limit(__rlimit_resource resource, std::uint64_t value) {
  rlimit now{};
  if (getrlimit(resource, &now) != 0) return;
  now.rlim_cur = now.rlim_max == RLIM_INFINITY ? value : std::min<rlim_t>(value, now.rlim_max);
  setrlimit(resource, &now);
}

std::uint64_t mapped_bytes() {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

void write_all(int pipe, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count = write(pipe, text.data() + done, text.size() - done);
    if (count <= 0) return;
    done += static_cast<std::size_t>(count);
  }
}

// Everything up to the end of the pipe; nothing when that takes longer than allowed.
std::optional<std::string> read_all(int pipe, std::chrono::seconds longest) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + longest;
  std::string text;
  char buffer[4096];
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
    pollfd ready{pipe, POLLIN, 0};
    if (left.count() <= 0) return std::nullopt;
    const int woken =
        poll(&ready, 1, static_cast<int>(std::min<std::int64_t>(left.count(), 60'000)));
    if (woken == 0 || (woken < 0 && errno == EINTR)) continue;
    const ssize_t count = read(pipe, buffer, sizeof buffer);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(buffer, static_cast<std::size_t>(count));
  }
}

[[noreturn]] void run_and_exit(const ChildLimits& limits, int pipe,
                               const std::function<std::string()>& body) {
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<std::uint64_t>(limits.cpu_seconds));
#ifndef __SANITIZE_ADDRESS__  // its shadow memory alone takes terabytes of addresses
  limit(RLIMIT_AS, mapped_bytes() + limits.added_bytes);
#endif
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU}) {
    signal(number, SIG_DFL);
  }
  try {
    write_all(pipe, body());
  } catch (const std::exception& error) {
    write_all(pipe, error.what());
  } catch (...) {
    write_all(pipe, "throws something that is no exception");
  }
  // Neither destructors nor buffers of the parent are ours.
  _exit(0);
}

}  // namespace

std::string run_in_child(const ChildLimits& limits, const std::function<std::string()>& body) {
  int ends[2];
  if (pipe(ends) != 0) return {};
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    run_and_exit(limits, ends[1], body);
  }
  close(ends[1]);
  const std::chrono::seconds longest(limits.clock_seconds);
  const auto text = child > 0 ? read_all(ends[0], longest) : std::string();
  close(ends[0]);
  if (!text) kill(child, SIGKILL);
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!text) return "takes more than " + std::to_string(longest.count()) + " s";
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU) {
    return "takes more than " + std::to_string(limits.cpu_seconds) + " s of processor time";
  }
  if (WIFSIGNALED(status)) return std::string("crashes: ") + strsignal(WTERMSIG(status));
  if (WIFEXITED(status) && WEXITSTATUS(status) != 0) return "crashes";
  return *text;
}

}  // namespace diorama::loader_assimp
