// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_schema.h"

#include <iostream>

#include "framework/config/value_text.h"
#include "framework/jobs/assemble.h"
#include "framework/pipeline/job.h"

namespace diorama {

std::vector<DescribedComponent> describe_all(Registry& registry, const Log& log) {
  std::vector<DescribedComponent> components;
  for (const ComponentEntry& entry : registry.components()) {
    try {
      components.push_back(
          {entry.kind, entry.type, entry.help, registry.describe(entry.kind, entry.type)});
    } catch (const Error& error) {
      log(LogLevel::Warning, error.what());
    }
  }
  return components;
}

int command_schema(const GlobalOptions& global, ConsoleLog& log) {
  const std::unique_ptr<Registry> registry = make_registry(global, log.sink());
  warn_of_rejected(*registry, log.sink());
  std::cout << to_json(job_schema(job_specs(), describe_all(*registry, log.sink())), 2) << "\n";
  return 0;
}

}  // namespace diorama
