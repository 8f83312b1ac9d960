// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "framework/host/console_log.h"

namespace diorama {

/// How far a long work is: done, rate and time left. On a terminal a line that is redrawn in place,
/// otherwise plain lines at most every ten seconds. Used by one thread.
class ProgressBar {
 public:
  /// `what` in the plural: "captures". `log` must outlive the bar.
  ProgressBar(ConsoleLog& log, std::string what, std::int64_t total);
  /// Removes the line.
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// `done` includes `resumed`, the part that was there before and does not count for the rate.
  void update(std::int64_t done, std::int64_t resumed = 0);

 private:
  ConsoleLog& log_;
  std::string what_;
  std::int64_t total_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_shown_;
};

/// "[=====>    ]  5/12 captures  0.8/s  9 s left". `bar_width` 0 leaves the bar out.
std::string progress_text(std::string_view what, std::int64_t done, std::int64_t total,
                          std::int64_t resumed, double seconds, int bar_width);

/// The same for a terminal that is so wide: with as much of the bar as there is room for, and cut
/// off where that is not enough. A line that is broken by the terminal cannot be redrawn.
std::string progress_line(std::string_view what, std::int64_t done, std::int64_t total,
                          std::int64_t resumed, double seconds, int columns);

}  // namespace diorama
