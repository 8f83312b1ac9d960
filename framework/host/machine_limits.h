// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

/// What the machine and this process's cgroups (version 2) leave to it. `root` is where /proc and
/// /sys are, for tests.
namespace diorama {

/// Bytes that this process may still take without others being swapped out: what the system says
/// is available, or what is left of the limits of its cgroups if that is less. The largest number
/// when nothing is known.
std::uint64_t available_memory(const std::filesystem::path& root = "/");

/// Bytes that the machine has, or that a cgroup may have if that is less. The largest number when
/// nothing is known.
std::uint64_t total_memory(const std::filesystem::path& root = "/");

/// Processors that the least quota of its cgroups amounts to, rounded up; 0: no quota.
int quota_cpus(const std::filesystem::path& root = "/");

/// Seconds since the machine started, summed over its processors.
struct ProcessorTime {
  double busy_s = 0.0;  ///< At work for anybody.
  double all_s = 0.0;
};

/// Nothing when it is not known.
std::optional<ProcessorTime> processor_time(const std::filesystem::path& root = "/");

/// What a thread has had of the processors since it began.
struct ThreadTime {
  double working_s = 0.0;
  double waiting_s = 0.0;  ///< It could have worked, but others did.
};

/// Of the threads that this process has now, by their numbers. Nothing when it is not known.
std::map<std::string, ThreadTime> thread_times(const std::filesystem::path& root = "/");

/// CPU seconds of this process so far, all threads, in the program and in the system for it.
double cpu_seconds();

}  // namespace diorama
