// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "diorama/config.h"
#include "framework/replicator/dialect.h"

/// Jobs of Isaac Sim's object-based data generation (standalone_examples/replicator/
/// object_based_sdg): objects that drift and fall within invisible walls, seen by cameras close to
/// them. One flat mapping of keys; those that the file lacks come from the built-in defaults.
namespace diorama {

/// Whether a top-level key belongs to this dialect alone.
bool is_object_based_key(std::string_view key);

/// True when the job has such a key.
bool is_object_based_job(const Value& job);

/// See translate_replicator_job().
ReplicatorTranslation translate_object_based_job(const Value& job, Diagnostics& diagnostics);

/// The example's built-in defaults, as YAML text (configs/object_based_default.yaml).
std::string builtin_object_based_job();

}  // namespace diorama
