// SPDX-License-Identifier: Apache-2.0
#include "framework/host/console_log.h"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/ansicolor_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>

#include "diorama/error.h"
#include "framework/config/clean_text.h"

namespace diorama {
namespace {

spdlog::level::level_enum level_of(LogLevel level) {
  switch (level) {
    case LogLevel::Debug:
      return spdlog::level::debug;
    case LogLevel::Info:
      return spdlog::level::info;
    case LogLevel::Warning:
      return spdlog::level::warn;
    case LogLevel::Error:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

bool stderr_is_terminal() {
  const char* kind = std::getenv("TERM");
  return isatty(STDERR_FILENO) == 1 && kind && std::strcmp(kind, "dumb") != 0;
}

}  // namespace

struct ConsoleLog::State {
  std::mutex mutex;  // over the sink and the status line, which share the screen
  // Own sink and logger instead of spdlog's registry, which is a global.
  std::shared_ptr<spdlog::sinks::ansicolor_stderr_sink_mt> sink =
      std::make_shared<spdlog::sinks::ansicolor_stderr_sink_mt>();
  spdlog::logger logger{"diorama", sink};
  bool is_terminal = stderr_is_terminal();
  std::string status;

  void erase_status() {
    if (!status.empty()) std::fputs("\r\x1b[K", stderr);
  }
  void draw_status() {
    if (status.empty()) return;
    std::fputs(status.c_str(), stderr);
    std::fflush(stderr);
  }
};

ConsoleLog::ConsoleLog(LogLevel least) : state_(std::make_unique<State>()) {
  state_->logger.set_level(level_of(least));
  state_->logger.flush_on(spdlog::level::debug);
  state_->sink->set_pattern(state_->is_terminal ? "%^%l%$: %v" : "%l: %v");
}

ConsoleLog::~ConsoleLog() { set_status({}); }

void ConsoleLog::write(LogLevel level, std::string_view message) {
  const std::lock_guard lock(state_->mutex);
  if (!state_->logger.should_log(level_of(level))) return;
  state_->erase_status();
  const std::string text = printable(message);
  state_->logger.log(level_of(level), spdlog::string_view_t(text.data(), text.size()));
  state_->draw_status();
}

Log ConsoleLog::sink() {
  return [this](LogLevel level, std::string_view message) { write(level, message); };
}

bool ConsoleLog::is_terminal() const { return state_->is_terminal; }

void ConsoleLog::set_status(std::string_view text) {
  if (!state_->is_terminal) return;
  const std::lock_guard lock(state_->mutex);
  state_->erase_status();
  state_->status = text;
  state_->draw_status();
  std::fflush(stderr);
}

LogLevel log_level_from(std::string_view word) {
  if (word == "debug") return LogLevel::Debug;
  if (word == "info") return LogLevel::Info;
  if (word == "warning") return LogLevel::Warning;
  if (word == "error") return LogLevel::Error;
  throw Error(ErrorKind::Usage, "log level '" + std::string(word) +
                                    "' is unknown; there are debug, info, warning and error");
}

}  // namespace diorama
