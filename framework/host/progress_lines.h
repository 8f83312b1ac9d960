// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <ostream>
#include <string>

namespace diorama {

/// How far a run is, for programs that wait for it: a line for each update.
class ProgressLines {
 public:
  enum class Format : std::uint8_t {
    Json,   ///< One object per line.
    OpenJd  ///< What Open Job Description asks of tasks: `openjd_progress: 41.7` and a status.
  };

  /// `stream` must outlive this.
  ProgressLines(Format format, std::ostream& stream);

  /// `done`: on disk. It includes `resumed`, which were there before and do not count for the rate.
  /// `respawned`: objects that had left the room and were placed anew. `refused`: views that were
  /// drawn again.
  void update(std::int64_t done, std::int64_t total, std::int64_t resumed, std::int64_t respawned,
              std::int64_t refused);

 private:
  Format format_;
  std::ostream& stream_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace diorama
