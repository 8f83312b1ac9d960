// SPDX-License-Identifier: Apache-2.0
// How long the program takes to start, beside a program that does nothing:
//   startup_bench [PROGRAM [REPETITIONS]]
// Commands take turns, so that all of them see the same machine; the first round warms the file
// cache and does not count. Ends with 1 when a median is above its limit.
#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

extern char** environ;

namespace {

struct Times {
  double passed_ms = 0;     ///< From asking for the process to its end.
  double processor_ms = 0;  ///< Of the process, in the system's share as well.
};

struct Command {
  std::string name;
  std::vector<std::string> words;
  double limit_ms;
  std::vector<Times> times{};
};

double milliseconds(const timeval& time) {
  return 1e3 * double(time.tv_sec) + 1e-3 * double(time.tv_usec);
}

/// Output is thrown away.
Times run(std::vector<std::string> words) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  posix_spawn_file_actions_addopen(&quiet, 1, "/dev/null", O_WRONLY, 0);
  const auto start = std::chrono::steady_clock::now();
  pid_t child = 0;
  int status = 0;
  rusage usage{};
  const bool has_run =
      posix_spawn(&child, arguments[0], &quiet, nullptr, arguments.data(), environ) == 0 &&
      wait4(child, &status, 0, &usage) == child && status == 0;
  const std::chrono::duration<double, std::milli> time = std::chrono::steady_clock::now() - start;
  posix_spawn_file_actions_destroy(&quiet);
  if (!has_run) {
    std::fprintf(stderr, "error: %s did not run well\n", arguments[0]);
    std::exit(2);
  }
  return {time.count(), milliseconds(usage.ru_utime) + milliseconds(usage.ru_stime)};
}

double median(const std::vector<Times>& times, double Times::*member) {
  std::vector<double> sorted;
  for (const Times& one : times) sorted.push_back(one.*member);
  std::ranges::sort(sorted);
  return sorted[sorted.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  const std::string program = argc > 1 ? argv[1] : DIORAMA_PROGRAM;
  const int repetitions = std::max(argc > 2 ? std::atoi(argv[2]) : 30, 1);
  std::vector<Command> commands{{"(nothing)", {"/bin/true"}, 1e9},
                                {"diorama --help", {program, "--help"}, 10},
                                {"diorama plugins", {program, "plugins"}, 50}};
  for (int round = -1; round < repetitions; ++round) {
    for (Command& command : commands) {
      const Times times = run(command.words);
      if (round >= 0) command.times.push_back(times);
    }
  }
  bool is_quick = true;
  for (const Command& command : commands) {
    const double passed = median(command.times, &Times::passed_ms);
    std::printf("%-16s median %6.2f ms, processor %6.2f ms", command.name.c_str(), passed,
                median(command.times, &Times::processor_ms));
    if (command.limit_ms < 1e9) std::printf(", limit %g ms", command.limit_ms);
    std::printf("\n");
    is_quick = is_quick && passed <= command.limit_ms;
  }
  return is_quick ? 0 : 1;
}
