// SPDX-License-Identifier: Apache-2.0
#include "framework/host/progress_lines.h"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <fstream>

namespace diorama {
namespace {

/// Memory that this process has in use (resident set), bytes; 0 where the system does not say.
std::uint64_t resident_bytes() {
  std::ifstream stream("/proc/self/statm");
  std::uint64_t all = 0;
  std::uint64_t resident = 0;
  if (!(stream >> all >> resident)) return 0;
  return resident * std::uint64_t(::sysconf(_SC_PAGESIZE));
}

}  // namespace

ProgressLines::ProgressLines(Format format, std::ostream& stream)
    : format_(format), stream_(stream), start_(std::chrono::steady_clock::now()) {}

void ProgressLines::update(std::int64_t done, std::int64_t total, std::int64_t resumed,
                           std::int64_t respawned, std::int64_t refused) {
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const double per_second = seconds > 0 ? double(done - resumed) / seconds : 0.0;
  if (format_ == Format::OpenJd) {
    const double percent = total > 0 ? 100.0 * double(done) / double(total) : 100.0;
    stream_ << fmt::format("openjd_progress: {:.1f}\nopenjd_status: {} of {} captures\n", percent,
                           done, total);
  } else {
    const std::string left =
        per_second > 0 ? fmt::format("{:.1f}", double(total - done) / per_second) : "null";
    stream_ << fmt::format(
        R"({{"done": {}, "total": {}, "resumed": {}, "per_minute": {:.2f}, "seconds_left": {}, )"
        R"("respawned": {}, "refused": {}, "rss_mib": {:.1f}}})"
        "\n",
        done, total, resumed, 60.0 * per_second, left, respawned, refused,
        double(resident_bytes()) / (1 << 20));
  }
  stream_.flush();
}

}  // namespace diorama
