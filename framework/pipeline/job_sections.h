// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "diorama/component.h"
#include "diorama/params.h"

namespace diorama {

/// A key of the job file that has keys or entries of its own. From this table, and the plain keys
/// (JobHead in job_keys.h), follow: which keys are known, what the host reads of an entry that
/// names a component, the job with all defaults, the reference, the schema and the completion.
struct JobSection {
  const char* key;
  ParamType type;  ///< Group, or List of entries.
  const char* help;
  std::vector<ParamSpec> (*keys)();  ///< Of the section, or of each entry: those of the host.
  /// Of the components that entries name by `type`; the other keys are theirs.
  std::optional<ComponentKind> kind = std::nullopt;
  const char* default_type = nullptr;  ///< Null: entries have to say it.
  /// What an entry without a name is called: "" for its type, '#' stands for its number. Null:
  /// entries have no names.
  const char* default_name = nullptr;
  /// What stands here when the job says nothing; what it says is as it is then. Null: the defaults
  /// of `keys`.
  Value (*when_absent)() = nullptr;
  bool is_left_out_when_empty = false;  ///< Of the job with all defaults.
};

/// In the order of the reference.
std::span<const JobSection> job_sections();

/// Null when there is none.
const JobSection* job_section(std::string_view key);

/// The keys of a job that are no sections.
const std::vector<ParamSpec>& plain_job_keys();

}  // namespace diorama
