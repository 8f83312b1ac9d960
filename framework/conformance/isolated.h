// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "framework/conformance/check_run.h"

namespace diorama::conformance {

/// How long one check may take before its process is killed.
struct CheckLimits {
  double busy_seconds = 120.0;  ///< Processor time, so that a slow machine is no fault.
  double idle_seconds = 30.0;   ///< Wall time in which no thread wants to run.
};

/// What must not matter to a component: each number stands for other addresses of libraries and of
/// memory, and for other environment variables. 0 leaves all as it is.
using Surroundings = unsigned;

/// What came of a process of checks.
struct Trial {
  std::vector<CheckResult> results;
  std::map<std::string, std::string> facts;  ///< What Journal::fact() was told, by name.
};

/// Runs checks in a child process, in an empty folder that is also its home and its place for
/// temporary files. A crash or a check beyond the limits ends the child and fails that check; all
/// that the child started is killed. Three more checks of `subject` follow: that nothing was
/// printed, no file left, and that the process ended without a complaint of a sanitizer.
Trial run_isolated(const std::string& subject, const std::function<void(Journal&)>& checks,
                   Surroundings surroundings = 0, const CheckLimits& limits = {});

}  // namespace diorama::conformance
