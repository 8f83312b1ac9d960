// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "framework/config/yaml_config.h"
#include "framework/pipeline/job.h"
#include "framework/replicator/dialect.h"

namespace diorama::test {

/// What is wrong with a file of the Replicator dialect, a line each.
inline std::string complaints_about(const std::string& yaml) {
  Complaints complaints;
  const ReplicatorTranslation translation =
      translate_replicator_job(parse_yaml(yaml, "job.yaml"), complaints);
  if (complaints.is_empty()) read_job(translation.job, complaints);
  std::string text;
  for (const std::string& message : complaints.messages()) text += message + "\n";
  return text;
}

}  // namespace diorama::test
