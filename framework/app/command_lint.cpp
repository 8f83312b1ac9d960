// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_lint.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "framework/app/heap.h"
#include "framework/app/standard_output.h"
#include "framework/config/yaml_config.h"
#include "framework/datasets/dataset_difference.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/lint/lint_dataset.h"
#include "framework/lint/scene_checks.h"
#include "framework/output/dataset_status.h"

namespace diorama {
namespace {

/// The job that a run was made of.
Value job_of(const std::string& run) {
  LocalFileSystem file_system;
  return parse_yaml(read_status(file_system, run, false).job, run + "/dataset.json: job");
}

/// With the job and the assets of the run.
LintReport lint_scenes_of(const std::string& run, const Value& job, const JobServices& services,
                          DatasetReaders& readers) {
  JobAssembly assembly = assemble_job(job, *services.registry, *services.host, services.assets_root,
                                      program_version(), AssembleFor::Run, 1);
  require_same_assets(run, assembly.dataset_json, services.assets_root);
  return lint_scenes(run, assembly.job, assembly.plan, assembly.components.sets.front(), readers,
                     *services.host);
}

}  // namespace

int command_lint(const GlobalOptions& global, const LintOptions& options, ConsoleLog& log) {
  keep_large_blocks();
  const Value job = options.looks_at_scenes ? job_of(options.dataset) : Value();
  const JobServices services = make_job_services(global, job, log.sink());
  DatasetReaders readers(*services.registry, *services.host);
  std::vector<LintReport> reports =
      lint_datasets(options.dataset, readers, *services.host, options.reader);
  if (options.looks_at_scenes) {
    reports.push_back(lint_scenes_of(options.dataset, job, services, readers));
  }
  return print_lint(reports, options.as_json);
}

int print_lint(const std::vector<LintReport>& reports, bool as_json) {
  if (as_json) {
    std::cout << lint_json(reports);
  } else {
    for (const LintReport& report : reports) print_text(lint_text(report));
  }
  const bool is_clean = std::ranges::all_of(
      reports, [](const LintReport& report) { return report.findings.empty(); });
  return is_clean ? 0 : kLintFoundFaults;
}

}  // namespace diorama
