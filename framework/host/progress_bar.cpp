// SPDX-License-Identifier: Apache-2.0
#include "framework/host/progress_bar.h"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "framework/host/terminal.h"

namespace diorama {
namespace {

constexpr auto kRedraw = std::chrono::milliseconds(100);
constexpr auto kPlainLine = std::chrono::seconds(10);
constexpr int kBarWidth = 24;

std::string duration_text(double seconds) {
  const auto whole = std::int64_t(seconds + 0.5);
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

std::string bar_text(std::int64_t done, std::int64_t total, int width) {
  const int full =
      total > 0 ? int(std::clamp<std::int64_t>(done * width / total, 0, width)) : width;
  std::string bar(std::size_t(full), '=');
  if (full > 0 && full < width) bar.back() = '>';
  bar.resize(std::size_t(width), ' ');
  return "[" + bar + "]  ";
}

}  // namespace

std::string progress_text(std::string_view what, std::int64_t done, std::int64_t total,
                          std::int64_t resumed, double seconds, int bar_width) {
  std::string text = bar_width > 0 ? bar_text(done, total, bar_width) : std::string();
  text += fmt::format("{}/{} {}", done, total, what);
  const double rate = seconds > 0 ? double(done - resumed) / seconds : 0.0;
  if (rate <= 0) return text;
  text += rate >= 1 ? fmt::format("  {:.1f}/s", rate) : fmt::format("  {:.1f} s each", 1 / rate);
  if (done < total) text += "  " + duration_text(double(total - done) / rate) + " left";
  return text;
}

std::string progress_line(std::string_view what, std::int64_t done, std::int64_t total,
                          std::int64_t resumed, double seconds, int columns) {
  constexpr int kLeastBar = 5;
  constexpr int kAroundBar = 4;  // brackets and spaces
  const std::string text = progress_text(what, done, total, resumed, seconds, 0);
  const int room = columns - 1;  // the cursor takes a place, too
  const int bar = std::min(kBarWidth, room - kAroundBar - int(text.size()));
  if (bar >= kLeastBar) return progress_text(what, done, total, resumed, seconds, bar);
  return text.substr(0, std::size_t(std::max(room, 0)));
}

ProgressBar::ProgressBar(ConsoleLog& log, std::string what, std::int64_t total)
    : log_(log),
      what_(std::move(what)),
      total_(total),
      start_(std::chrono::steady_clock::now()),
      last_shown_(start_ - std::chrono::hours(1)) {
  update(0);
}

ProgressBar::~ProgressBar() { log_.set_status({}); }

void ProgressBar::update(std::int64_t done, std::int64_t resumed) {
  const auto now = std::chrono::steady_clock::now();
  const bool is_terminal = log_.is_terminal();
  const bool is_due = is_terminal ? now - last_shown_ >= kRedraw : now - last_shown_ >= kPlainLine;
  if (!is_due && done < total_) return;
  last_shown_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  if (is_terminal) {
    const int columns = terminal_columns(STDERR_FILENO);
    log_.set_status(progress_line(what_, done, total_, resumed, seconds, columns));
  } else {
    log_.write(LogLevel::Info, progress_text(what_, done, total_, resumed, seconds, 0));
  }
}

}  // namespace diorama
