// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace diorama::conformance {

enum class Outcome : std::uint8_t { Passed, Failed, Skipped };

/// "passed", "failed", "skipped".
std::string outcome_name(Outcome outcome);

/// One thing that was tried with a plugin.
struct CheckResult {
  std::string subject;  ///< The file's name, or "writer/boxes".
  std::string check;    ///< "unknown keys are refused"
  Outcome outcome = Outcome::Passed;
  std::string message;  ///< Why it failed or was skipped.
};

/// Is told of every check before it begins and after it ended, so that a crash can be laid at the
/// right door.
class Journal {
 public:
  virtual ~Journal() = default;
  virtual void begin(const std::string& subject, const std::string& check) = 0;
  virtual void end(const CheckResult& result) = 0;
  /// Something that the checks found out for whoever runs them.
  virtual void fact(const std::string& name, const std::string& value) = 0;
};

/// Runs the checks of one subject.
class CheckRun {
 public:
  CheckRun(Journal& journal, std::string subject)
      : journal_(journal), subject_(std::move(subject)) {}

  /// Whatever `body` throws is the failure's message. True when nothing was thrown.
  bool check(const std::string& name, const std::function<void()>& body) const;
  void skip(const std::string& name, const std::string& reason) const;

 private:
  Journal& journal_;
  std::string subject_;
};

/// Throws Error(Plugin) with the failure unless the condition is met.
void require(bool is_met, const std::string& failure);

/// What the call throws must be a diorama::Error whose text names `name`.
void require_error_naming(const std::string& name, const std::function<void()>& call);

}  // namespace diorama::conformance
