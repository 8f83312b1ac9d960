// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "framework/config/yaml_config.h"
#include "framework/pipeline/job.h"

namespace diorama::test {

/// A job that is complete and right, as a start for tests that break one thing.
inline std::string good_job() {
  return R"(seed: 5
total_captures: 7
environments: [{type: files, files: [a.usd, b.usd]}]
objects:
  - {type: files, name: targets, under: /Assets, count: 20, label_pattern: "^\\d+_", gravity_disabled_chance: 0.25}
  - {type: shapes, name: clutter, under: /Distractors, count: 8}
cameras: [{type: pinhole, name: cam, count: 2, width: 64, height: 48}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment]}
  - {type: orbit_cameras, name: orbit, on: [floating, dropped]}
timeline: [{simulate: 4}, {capture: floating, count: 2}, {simulate: 200}, {capture: dropped, count: 1}]
writers: [{type: BasicWriter, name: basic, rgb: true}]
output: {folder: out}
)";
}

inline Value job_value(const std::string& yaml) { return parse_yaml(yaml, "job.yaml"); }

/// Throws Error(Config) with all diagnostics.
inline Job job_from(const std::string& yaml) {
  Diagnostics diagnostics;
  Job job = read_job(job_value(yaml), diagnostics);
  diagnostics.raise();
  return job;
}

/// All diagnostics, one per line.
inline std::string complaints_about(const std::string& yaml) {
  Diagnostics diagnostics;
  read_job(job_value(yaml), diagnostics);
  std::string text;
  for (const std::string& message : diagnostics.messages()) text += message + "\n";
  return text;
}

/// Replaces one line's text; fails the test when it is not there.
inline std::string with(std::string yaml, const std::string& from, const std::string& to) {
  const std::size_t place = yaml.find(from);
  if (place == std::string::npos) throw std::logic_error("no \"" + from + "\" in the job");
  return yaml.replace(place, from.size(), to);
}

}  // namespace diorama::test
