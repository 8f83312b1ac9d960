// SPDX-License-Identifier: Apache-2.0
#include "framework/jobs/job_file.h"

#include <algorithm>

#include "framework/config/job_overrides.h"
#include "framework/config/yaml_config.h"
#include "framework/pipeline/job.h"
#include "framework/replicator/dialect.h"

namespace diorama {
namespace {

Value from_command_line(Value value, const char* option) {
  value.place.file = option;
  return value;
}

/// Keys of the Replicator dialect are set before the translation, those of jobs after it. What is
/// neither is a mistake in a file of the dialect, which says so with the nearest key.
bool is_replicator_key(const std::string& assignment) {
  const std::string key = assignment.substr(0, assignment.find_first_of(".[="));
  return is_replicator_section(key) ||
         std::ranges::none_of(job_specs(), [&](const ParamSpec& spec) { return spec.key == key; });
}

Value translated(const Value& job, const Log& log) {
  Diagnostics diagnostics;
  ReplicatorTranslation translation = translate_replicator_job(job, diagnostics);
  diagnostics.raise();
  std::string keys;
  for (const std::string& key : translation.without_effect) {
    keys += (keys.empty() ? "" : ", ") + key;
  }
  if (!keys.empty()) log(LogLevel::Info, "accepted, but without effect here: " + keys);
  return std::move(translation.job);
}

}  // namespace

Value load_job(const JobOptions& options, const Log& log) {
  return native_job(options.job.empty()
                        ? parse_yaml(builtin_replicator_job(), "built-in infinigen_default.yaml")
                        : read_job_file(options.job),
                    options, log);
}

Value native_job(Value job, const JobOptions& options, const Log& log) {
  const bool is_replicator = is_replicator_job(job);
  for (const std::string& assignment : options.sets) {
    if (is_replicator && is_replicator_key(assignment)) apply_set(job, assignment);
  }
  if (is_replicator) job = translated(job, log);
  for (const std::string& assignment : options.sets) {
    if (!is_replicator || !is_replicator_key(assignment)) apply_set(job, assignment);
  }
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

Value job_of(const DatasetStatus& status, const std::filesystem::path& folder) {
  Value job = parse_yaml(status.job, "the job in dataset.json");
  Value* output = job.find("output");
  if (!output) output = &job.set("output", Value::make_map());
  output->set("folder", Value::text(folder.string()));
  return job;
}

}  // namespace diorama
