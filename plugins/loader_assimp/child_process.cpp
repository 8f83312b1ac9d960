// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/child_process.h"

#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <exception>
#include <fstream>
#include <string>
#include <utility>

#include "diorama/abi.h"

namespace diorama::loader_assimp {
namespace {

// A child inherits the locks that other threads held at that moment, and nobody is left in it to
// release them. malloc and stdio know how to deal with that, address sanitizer's malloc and other
// code do not. Such a child sleeps for ever; the next one hardly meets the same moment.
constexpr int kMostTries = 3;
constexpr std::chrono::milliseconds kStandstill{1000};

enum class Ending { Complete, TookTooLong, StoodStill };

struct Answer {
  Ending ending = Ending::Complete;
  std::string text;
};

void limit(__rlimit_resource resource, std::uint64_t value) {
  rlimit now{};
  if (getrlimit(resource, &now) != 0) return;
  now.rlim_cur = now.rlim_max == RLIM_INFINITY ? value : std::min<rlim_t>(value, now.rlim_max);
  setrlimit(resource, &now);
}

// On top of the memory that the process has already.
void limit_added_memory([[maybe_unused]] std::uint64_t bytes) {
#if !DIORAMA_DETAIL_ADDRESS_SANITIZER  // its shadow memory alone takes terabytes of addresses
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  limit(RLIMIT_AS, pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) + bytes);
#endif
}

void write_all(int pipe, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count = write(pipe, text.data() + done, text.size() - done);
    if (count <= 0) return;
    done += static_cast<std::size_t>(count);
  }
}

// Sleeps without having worked since `worked_before`, which is brought up to date. Waiting for a
// disk or for a processor is no sleep.
bool stands_still(pid_t child, std::int64_t& worked_before) {
  clockid_t clock{};
  timespec worked{};
  if (clock_getcpuclockid(child, &clock) != 0 || clock_gettime(clock, &worked) != 0) return false;
  const std::int64_t now = std::int64_t(worked.tv_sec) * 1'000'000'000 + worked.tv_nsec;
  const bool has_worked = std::exchange(worked_before, now) != now;
  std::string line;
  std::getline(std::ifstream("/proc/" + std::to_string(child) + "/stat"), line);
  const std::size_t name_end = line.rfind(") ");
  return !has_worked && name_end != std::string::npos && line.compare(name_end + 2, 1, "S") == 0;
}

// What comes through the pipe up to its end.
Answer read_all(int pipe, pid_t child, std::chrono::milliseconds longest, bool may_stand_still) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + longest;
  std::int64_t worked = -1;
  Answer answer;
  char buffer[4096];
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
    if (left.count() <= 0) return {Ending::TookTooLong, {}};
    pollfd ready{pipe, POLLIN, 0};
    const int woken = poll(&ready, 1, static_cast<int>(std::min(left, kStandstill).count()));
    if (woken < 0 && errno == EINTR) continue;
    if (woken == 0) {
      if (!may_stand_still && stands_still(child, worked)) return {Ending::StoodStill, {}};
      continue;
    }
    const ssize_t count = read(pipe, buffer, sizeof buffer);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return answer;
    answer.text.append(buffer, static_cast<std::size_t>(count));
  }
}

[[noreturn]] void run_and_exit(const ChildLimits& limits, int pipe,
                               const std::function<std::string()>& body) {
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<std::uint64_t>(limits.cpu_seconds));
  limit_added_memory(limits.added_bytes);
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

// What the child said, or what it died of.
Answer try_in_child(const ChildLimits& limits, bool may_stand_still,
                    const std::function<std::string()>& body) {
  int ends[2];
  if (pipe(ends) != 0) return {};
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    run_and_exit(limits, ends[1], body);
  }
  close(ends[1]);
  Answer answer;
  const std::chrono::seconds longest(limits.clock_seconds);
  if (child > 0) answer = read_all(ends[0], child, longest, may_stand_still);
  close(ends[0]);
  if (answer.ending != Ending::Complete) kill(child, SIGKILL);
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (answer.ending == Ending::TookTooLong) {
    answer.text = "takes more than " + std::to_string(longest.count()) + " s";
  } else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU) {
    answer.text = "takes more than " + std::to_string(limits.cpu_seconds) + " s of processor time";
  } else if (WIFSIGNALED(status)) {
    answer.text = std::string("crashes: ") + strsignal(WTERMSIG(status));
  } else if (WIFEXITED(status) && WEXITSTATUS(status) != 0) {
    answer.text = "crashes";
  }
  return answer;
}

}  // namespace

std::string run_in_child(const ChildLimits& limits, const std::function<std::string()>& body) {
  for (int tries = 1; tries < kMostTries; ++tries) {
    Answer answer = try_in_child(limits, false, body);
    if (answer.ending != Ending::StoodStill) return std::move(answer.text);
  }
  return try_in_child(limits, true, body).text;
}

}  // namespace diorama::loader_assimp
