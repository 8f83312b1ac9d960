// SPDX-License-Identifier: Apache-2.0
#include "framework/host/machine_limits.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kUnknown = std::numeric_limits<std::uint64_t>::max();

/// The number that a file consists of; none for "max" and when there is no such file.
std::optional<std::uint64_t> number_in(const fs::path& file) {
  std::ifstream stream(file);
  std::uint64_t number = 0;
  if (!(stream >> number)) return std::nullopt;
  return number;
}

std::uint64_t system_memory(const fs::path& root, std::string_view wanted) {
  std::ifstream stream(root / "proc/meminfo");
  for (std::string line; std::getline(stream, line);) {
    std::istringstream words(line);
    std::string key;
    std::uint64_t kibibytes = 0;
    if (words >> key >> kibibytes && key == wanted) return kibibytes << 10;
  }
  return kUnknown;
}

/// Pages of files that are cached count as used there, but give way.
std::uint64_t reclaimable(const fs::path& group) {
  std::ifstream stream(group / "memory.stat");
  std::string key;
  std::uint64_t bytes = 0;
  while (stream >> key >> bytes) {
    if (key == "inactive_file") return bytes;
  }
  return 0;
}

std::uint64_t memory_left(const fs::path& group) {
  const auto limit = number_in(group / "memory.max");
  const auto used = number_in(group / "memory.current");
  if (!limit || !used) return kUnknown;
  const std::uint64_t held = *used - std::min(*used, reclaimable(group));
  return *limit - std::min(*limit, held);
}

/// Where this process is among the groups, "/system.slice/job_7"; "/" in a container of its own.
fs::path own_group(const fs::path& root) {
  std::ifstream stream(root / "proc/self/cgroup");
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("0::/")) return line.substr(3);
  }
  return "/";
}

/// The groups that this process is in, outermost first: a limit holds for all groups below.
std::vector<fs::path> own_groups(const fs::path& root) {
  std::vector<fs::path> groups{root / "sys/fs/cgroup"};
  for (const fs::path& name : own_group(root).relative_path()) {
    groups.push_back(groups.back() / name);
  }
  return groups;
}

}  // namespace

std::uint64_t available_memory(const fs::path& root) {
  std::uint64_t least = system_memory(root, "MemAvailable:");
  for (const fs::path& group : own_groups(root)) least = std::min(least, memory_left(group));
  return least;
}

std::uint64_t total_memory(const fs::path& root) {
  std::uint64_t least = system_memory(root, "MemTotal:");
  for (const fs::path& group : own_groups(root)) {
    least = std::min(least, number_in(group / "memory.max").value_or(kUnknown));
  }
  return least;
}

int quota_cpus(const fs::path& root) {
  int least = 0;
  for (const fs::path& group : own_groups(root)) {
    std::ifstream stream(group / "cpu.max");
    double quota = 0.0;  // "max" is no number
    double period = 0.0;
    if (!(stream >> quota >> period) || !(quota > 0.0 && period > 0.0)) continue;
    const int cpus = int(std::min(std::ceil(quota / period), 1e6));
    least = least == 0 ? cpus : std::min(least, cpus);
  }
  return least;
}

std::optional<ProcessorTime> processor_time(const fs::path& root) {
  // user nice system idle iowait irq softirq steal
  constexpr std::size_t kIdle = 3;
  constexpr std::size_t kWaiting = 4;
  std::array<double, 8> ticks{};
  std::ifstream stream(root / "proc/stat");
  std::string key;
  if (!(stream >> key) || key != "cpu") return std::nullopt;
  for (double& each : ticks) {
    if (!(stream >> each)) return std::nullopt;
  }
  const double per_s = double(sysconf(_SC_CLK_TCK));
  ProcessorTime time;
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    time.all_s += ticks[i] / per_s;
    if (i != kIdle && i != kWaiting) time.busy_s += ticks[i] / per_s;
  }
  return time;
}

std::map<std::string, ThreadTime> thread_times(const fs::path& root) {
  std::map<std::string, ThreadTime> times;
  std::error_code error;
  fs::directory_iterator threads(root / "proc/self/task", error);
  // Threads may end meanwhile.
  for (; !error && threads != fs::directory_iterator(); threads.increment(error)) {
    std::ifstream stream(threads->path() / "schedstat");
    double working_ns = 0.0;
    double waiting_ns = 0.0;
    if (!(stream >> working_ns >> waiting_ns)) continue;
    times[threads->path().filename().string()] = {working_ns * 1e-9, waiting_ns * 1e-9};
  }
  return times;
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace diorama
