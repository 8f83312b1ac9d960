// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "framework/config/yaml_config.h"
#include "framework/pipeline/job.h"
#include "framework/replicator/dialect.h"

namespace diorama::test {

/// What is wrong with a file of the Replicator dialect, a line each.
inline std::string complaints_about(const std::string& yaml) {
  Diagnostics diagnostics;
  const ReplicatorTranslation translation =
      translate_replicator_job(parse_yaml(yaml, "job.yaml"), diagnostics);
  if (diagnostics.is_empty()) read_job(translation.job, diagnostics);
  std::string text;
  for (const std::string& message : diagnostics.messages()) text += message + "\n";
  return text;
}

}  // namespace diorama::test
