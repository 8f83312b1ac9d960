// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "diorama/host.h"
#include "framework/host/log.h"

namespace diorama {

/// Messages on stderr, one line each, with an optional status line below them on terminals. Safe
/// from any thread.
class ConsoleLog {
 public:
  explicit ConsoleLog(LogLevel least);
  ~ConsoleLog();

  void write(LogLevel level, std::string_view message);
  /// A function that writes here; the ConsoleLog must outlive it.
  Log sink();

  /// True when stderr is a terminal that understands the status line.
  bool is_terminal() const;
  /// Replaces the status line; empty removes it. Does nothing when stderr is no terminal.
  void set_status(std::string_view text);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// "debug", "info", "warning", "error"; throws Error(Usage) for other words.
LogLevel log_level_from(std::string_view word);

}  // namespace diorama
