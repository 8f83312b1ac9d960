// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_config.h"

#include <iostream>

#include "framework/config/value_text.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/job_file.h"
#include "framework/pipeline/job.h"

namespace diorama {

int command_config(const GlobalOptions& global, const JobOptions& options, bool as_json,
                   ConsoleLog& log) {
  const Value job = load_job(options, log.sink());
  const JobServices services = make_job_services(global, job, log.sink());
  const Value resolved = check_job(job, *services.registry, *services.host);
  std::cout << (as_json ? to_json(resolved, 2) + "\n" : to_yaml(resolved));
  return 0;
}

}  // namespace diorama
