// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_lint.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "framework/config/clean_text.h"
#include "framework/config/yaml_config.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/lint/lint_dataset.h"
#include "framework/lint/scene_checks.h"
#include "framework/output/dataset_status.h"

namespace diorama {
namespace {

/// With the job and the assets of the run.
LintReport lint_scenes_of(const GlobalOptions& global, const std::string& run, ConsoleLog& log) {
  LocalFileSystem file_system;
  const DatasetStatus status = read_status(file_system, run, false);
  const Value job = parse_yaml(status.job, run + "/dataset.json: job");
  const JobServices services = make_job_services(global, job, log.sink());
  JobAssembly assembly = assemble_job(job, *services.registry, *services.host, services.assets_root,
                                      program_version(), AssembleFor::Plan, 1);
  return lint_scenes(run, assembly.job, assembly.plan, assembly.components.sets.front(),
                     *services.host);
}

}  // namespace

int command_lint(const GlobalOptions& global, const LintOptions& options, ConsoleLog& log) {
  const JobServices services = make_services(global, log.sink());
  DatasetReaders readers(*services.registry, *services.host);
  std::vector<LintReport> reports =
      lint_datasets(options.dataset, readers, *services.host, options.reader);
  if (options.looks_at_scenes) reports.push_back(lint_scenes_of(global, options.dataset, log));
  return print_lint(reports, options.as_json);
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
