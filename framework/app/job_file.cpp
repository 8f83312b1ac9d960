// SPDX-License-Identifier: Apache-2.0
#include "framework/app/job_file.h"

#include "framework/config/job_overrides.h"
#include "framework/config/yaml_config.h"

namespace diorama {
namespace {

Value from_command_line(Value value, const char* option) {
  value.place.file = option;
  return value;
}

}  // namespace

Value load_job(const JobOptions& options, const Log&) {
  Value job = read_job_file(options.job);
  for (const std::string& assignment : options.sets) apply_set(job, assignment);
  if (options.seed) {
    Value seed;
    seed.kind = Value::Kind::Scalar;
    seed.scalar = std::to_string(*options.seed);
    job.set("seed", from_command_line(std::move(seed), "--seed"));
  }
  if (options.output) {
    Value output = job.find("output") ? *job.find("output") : Value::make_map();
    output.set("folder", from_command_line(Value::text(*options.output), "--output"));
    job.set("output", std::move(output));
  }
  return job;
}

}  // namespace diorama
