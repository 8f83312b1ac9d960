// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diorama/config.h"

/// The second dialect of jobs: files of NVIDIA's examples. Those of the tutorial on synthetic data
/// with Infinigen rooms (`environments, capture, writers, labeled_assets, distractors, physics,
/// debug_mode`), and those of object-based data generation (object_based.h). They are translated
/// into the native job before anything else sees them. framework/docs/replicator_compatibility.md
/// says what each key becomes and what is done differently.
namespace diorama {

/// True when the job has keys that only this dialect knows.
bool is_replicator_job(const Value& job);

/// True for top-level keys that native jobs do not have.
bool is_replicator_section(std::string_view key);

struct ReplicatorTranslation {
  Value job;  ///< Native. Values keep their places in the file.
  /// Keys that were accepted and have no effect here, each with the reason.
  std::vector<std::string> without_effect;
};

/// Unknown keys, wrong types and values out of range are added to `diagnostics`; the result is of
/// use only when there are none. Like in the reference, a top-level key that the file lacks comes
/// from the built-in defaults as a whole, and a key missing inside a given block takes the fallback
/// of the reference's program.
ReplicatorTranslation translate_replicator_job(const Value& job, Diagnostics& diagnostics);

/// The tutorial's built-in defaults, as YAML text in this dialect (configs/infinigen_default.yaml).
std::string builtin_replicator_job();

}  // namespace diorama
