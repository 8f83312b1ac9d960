// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "framework/conformance/check_run.h"

namespace diorama::conformance {

/// Runs checks in a child process, in an empty folder that is also its home and its place for
/// temporary files. A crash or a check that takes minutes ends the child and fails that check.
/// Three more checks of `subject` follow: that nothing was printed, no file left, and that the
/// process ended without a complaint of a sanitizer.
std::vector<CheckResult> run_isolated(const std::string& subject,
                                      const std::function<void(Journal&)>& checks);

}  // namespace diorama::conformance
