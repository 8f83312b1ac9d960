// SPDX-License-Identifier: Apache-2.0
#include "framework/host/machine_memory.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>

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

std::uint64_t system_memory(const fs::path& root) {
  std::ifstream stream(root / "proc/meminfo");
  for (std::string line; std::getline(stream, line);) {
    std::istringstream words(line);
    std::string key;
    std::uint64_t kibibytes = 0;
    if (words >> key >> kibibytes && key == "MemAvailable:") return kibibytes << 10;
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

std::uint64_t group_memory(const fs::path& group) {
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

}  // namespace

std::uint64_t available_memory(const fs::path& root) {
  const fs::path groups = root / "sys/fs/cgroup";
  std::uint64_t least = std::min(system_memory(root), group_memory(groups));
  // A limit holds for all groups below.
  fs::path group = groups;
  for (const fs::path& name : own_group(root).relative_path()) {
    group /= name;
    least = std::min(least, group_memory(group));
  }
  return least;
}

}  // namespace diorama
