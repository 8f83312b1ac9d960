// SPDX-License-Identifier: Apache-2.0
#include "framework/host/machine_limits.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <string>

#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

/// A folder in which a machine says what memory it has.
class Machine {
 public:
  Machine() {
    std::string pattern = (fs::temp_directory_path() / "diorama-memory-XXXXXX").string();
    root_ = ::mkdtemp(pattern.data());
  }
  ~Machine() { fs::remove_all(root_); }
  void says(const std::string& file, const std::string& text) const {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  std::uint64_t memory() const { return available_memory(root_); }
  std::uint64_t all_memory() const { return total_memory(root_); }
  int cpus() const { return quota_cpus(root_); }
  std::optional<ProcessorTime> time() const { return processor_time(root_); }
  std::map<std::string, ThreadTime> threads() const { return thread_times(root_); }

 private:
  fs::path root_;
};

}  // namespace

TEST_CASE("available memory is the system's, or what a cgroup leaves if that is less", "[host]") {
  const Machine machine;
  CHECK(machine.memory() == std::numeric_limits<std::uint64_t>::max());
  machine.says("proc/meminfo", "MemTotal: 16 kB\nMemFree:  3 kB\nMemAvailable:    9000 kB\n");
  CHECK(machine.memory() == 9000 * 1024);
  machine.says("sys/fs/cgroup/memory.current", "4000000\n");
  machine.says("sys/fs/cgroup/memory.max", "max\n");
  CHECK(machine.memory() == 9000 * 1024);
  machine.says("sys/fs/cgroup/memory.max", "5000000\n");
  CHECK(machine.memory() == 1'000'000);
  machine.says("sys/fs/cgroup/memory.stat", "anon 5\nfile 70\ninactive_file 500000\nx 1\n");
  CHECK(machine.memory() == 1'500'000);
  machine.says("proc/self/cgroup", "1:cpu:/other\n0::/slice/job_7\n");
  CHECK(machine.memory() == 1'500'000);
  machine.says("sys/fs/cgroup/slice/memory.current", "100\n");
  machine.says("sys/fs/cgroup/slice/memory.max", "700100\n");
  machine.says("sys/fs/cgroup/slice/job_7/memory.current", "100\n");
  machine.says("sys/fs/cgroup/slice/job_7/memory.max", "max\n");
  CHECK(machine.memory() == 700'000);
  machine.says("sys/fs/cgroup/memory.current", "6000000\n");
  CHECK(machine.memory() == 0);
}

TEST_CASE("all memory is the machine's, or the least limit of the cgroups", "[host]") {
  const Machine machine;
  CHECK(machine.all_memory() == std::numeric_limits<std::uint64_t>::max());
  machine.says("proc/meminfo", "MemTotal: 16 kB\nMemAvailable:    9 kB\n");
  CHECK(machine.all_memory() == 16 * 1024);
  machine.says("proc/self/cgroup", "0::/pods/pod_3\n");
  machine.says("sys/fs/cgroup/memory.max", "12000\n");
  machine.says("sys/fs/cgroup/pods/memory.max", "9000\n");
  machine.says("sys/fs/cgroup/pods/pod_3/memory.max", "max\n");
  CHECK(machine.all_memory() == 9000);
}

TEST_CASE("processors are counted by the least quota of all cgroups around", "[host]") {
  const Machine machine;
  CHECK(machine.cpus() == 0);
  machine.says("sys/fs/cgroup/cpu.max", "max 100000\n");
  CHECK(machine.cpus() == 0);
  machine.says("proc/self/cgroup", "0::/slice/job_7\n");
  machine.says("sys/fs/cgroup/slice/cpu.max", "350000 100000\n");
  CHECK(machine.cpus() == 4);
  machine.says("sys/fs/cgroup/slice/job_7/cpu.max", "150000 100000\n");
  CHECK(machine.cpus() == 2);
  machine.says("sys/fs/cgroup/cpu.max", "50000 100000\n");
  CHECK(machine.cpus() == 1);
  machine.says("sys/fs/cgroup/cpu.max", "100000 0\n");
  CHECK(machine.cpus() == 2);
}

TEST_CASE("this machine has some memory", "[host]") {
  CHECK(available_memory() > (std::uint64_t(1) << 20));
  CHECK(total_memory() >= available_memory());
}

TEST_CASE("the time of processors is that of the first line, waiting for disks is no work",
          "[host]") {
  const Machine machine;
  CHECK_FALSE(machine.time());
  machine.says("proc/stat", "cpu  100 20 30 4000\n");
  CHECK_FALSE(machine.time());
  machine.says("proc/stat", "cpu  100 20 30 4000 500 6 7 8 9 10\ncpu0 1 1 1 1 1 1 1 1 1 1\n");
  REQUIRE(machine.time());
  const double per_s = double(sysconf(_SC_CLK_TCK));
  CHECK(machine.time()->busy_s == Approx((100 + 20 + 30 + 6 + 7 + 8) / per_s));
  CHECK(machine.time()->all_s == Approx((171 + 4000 + 500) / per_s));
}

TEST_CASE("threads say how long they worked and how long others did instead", "[host]") {
  const Machine machine;
  CHECK(machine.threads().empty());
  machine.says("proc/self/task/71/schedstat", "2500000000 500000000 12\n");
  machine.says("proc/self/task/72/schedstat", "1000000 0 1\n");
  machine.says("proc/self/task/73/comm", "has just ended\n");
  const auto threads = machine.threads();
  REQUIRE(threads.size() == 2);
  CHECK(threads.at("71").working_s == Approx(2.5));
  CHECK(threads.at("71").waiting_s == Approx(0.5));
  CHECK(threads.at("72").working_s == Approx(1e-3));
  CHECK(threads.at("72").waiting_s == 0.0);
}
