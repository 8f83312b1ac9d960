// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_lint.h"

#include <algorithm>
#include <iostream>
#include <memory>

#include "framework/config/clean_text.h"
#include "framework/jobs/assemble.h"
#include "framework/lint/lint_dataset.h"

namespace diorama {

int command_lint(const GlobalOptions& global, const LintOptions& options, ConsoleLog& log) {
  const JobServices services = make_services(global, log.sink());
  DatasetReaders readers(*services.registry, *services.host);
  return print_lint(lint_datasets(options.dataset, readers, *services.host, options.reader),
                    options.as_json);
}

int print_lint(const std::vector<LintReport>& reports, bool as_json) {
  if (as_json) {
    std::cout << lint_json(reports);
  } else {
    for (const LintReport& report : reports) std::cout << printable(lint_text(report));
  }
  const bool is_clean = std::ranges::all_of(
      reports, [](const LintReport& report) { return report.findings.empty(); });
  return is_clean ? 0 : kLintFoundFaults;
}

}  // namespace diorama
