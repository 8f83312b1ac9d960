// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_lint.h"

#include <algorithm>
#include <iostream>

#include "framework/config/clean_text.h"
#include "framework/lint/lint_dataset.h"

namespace diorama {

int command_lint(const LintOptions& options) {
  const std::vector<LintReport> reports = lint_datasets(options.dataset);
  if (options.as_json) {
    std::cout << lint_json(reports);
  } else {
    for (const LintReport& report : reports) std::cout << printable(lint_text(report));
  }
  const bool is_clean = std::ranges::all_of(
      reports, [](const LintReport& report) { return report.findings.empty(); });
  return is_clean ? 0 : kLintFoundFaults;
}

}  // namespace diorama
