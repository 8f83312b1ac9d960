// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/check_run.h"

#include <exception>

#include "diorama/error.h"

namespace diorama::conformance {

std::string outcome_name(Outcome outcome) {
  switch (outcome) {
    case Outcome::Passed:
      return "passed";
    case Outcome::Failed:
      return "failed";
    case Outcome::Skipped:
      return "skipped";
  }
  return "";
}

bool CheckRun::check(const std::string& name, const std::function<void()>& body) const {
  CheckResult result{subject_, name, Outcome::Failed, {}};
  journal_.begin(subject_, name);
  try {
    body();
    result.outcome = Outcome::Passed;
  } catch (const std::exception& error) {
    result.message = error.what();
  } catch (...) {
    result.message = "threw something that is no std::exception";
  }
  journal_.end(result);
  return result.outcome == Outcome::Passed;
}

void CheckRun::skip(const std::string& name, const std::string& reason) const {
  journal_.end({subject_, name, Outcome::Skipped, reason});
}

void require(bool is_met, const std::string& failure) {
  if (!is_met) throw Error(ErrorKind::Plugin, failure);
}

void require_error_naming(const std::string& name, const std::function<void()>& call) {
  std::string message;
  try {
    call();
  } catch (const Error& error) {
    message = error.what();
  }
  require(!message.empty(), "accepts '" + name + "', expected an error");
  require(message.find(name) != std::string::npos,
          "the error for '" + name + "' does not name it: " + message);
}

}  // namespace diorama::conformance
