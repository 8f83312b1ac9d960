// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_config.h"

#include <iostream>

#include "framework/app/assemble.h"
#include "framework/app/assemble_job.h"
#include "framework/app/job_file.h"
#include "framework/config/value_text.h"
#include "framework/pipeline/job.h"

namespace diorama {

int command_config(const GlobalOptions& global, const JobOptions& options, bool as_json,
                   ConsoleLog& log) {
  const Value job = load_job(options, log.sink());
  const std::unique_ptr<Registry> registry = make_registry(global, log.sink());
  warn_of_rejected(*registry, log.sink());
  const auto host =
      make_host(*registry, global, assets_root_of(job), log.sink(), asset_prefixes_of(job));
  const Value resolved = check_job(job, *registry, *host);
  std::cout << (as_json ? to_json(resolved, 2) + "\n" : to_yaml(resolved));
  return 0;
}

}  // namespace diorama
