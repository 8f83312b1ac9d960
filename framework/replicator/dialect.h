// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/config.h"

/// The second dialect of jobs: the keys of NVIDIA's tutorial on synthetic data with Infinigen rooms
/// (`environments, capture, writers, labeled_assets, distractors, physics, debug_mode`). It is
/// translated into the native job before anything else sees it. framework/docs/
/// replicator_compatibility.md says what each key becomes and what is done differently.
namespace diorama {

/// True when the job has keys that only this dialect knows.
bool is_replicator_job(const Value& job);

struct ReplicatorTranslation {
  Value job;  ///< Native. Values keep their places in the file.
  /// Keys that were accepted and have no effect here, each with the reason.
  std::vector<std::string> without_effect;
};

/// Unknown keys, wrong types and values out of range are added to `complaints`; the result is of
/// use only when there are none. Like in the reference, a top-level key that the file lacks comes
/// from the built-in defaults as a whole, and a key missing inside a given block takes the fallback
/// of the reference's program.
ReplicatorTranslation translate_replicator_job(const Value& job, Complaints& complaints);

/// The tutorial's built-in defaults, as YAML text in this dialect (configs/infinigen_default.yaml).
std::string builtin_replicator_job();

}  // namespace diorama
