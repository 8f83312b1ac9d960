// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "diorama/config.h"

/// Job files as Value trees. YAML and JSON (which is read as the YAML that it is) go through one
/// parser; every value keeps the place where it stands.
namespace diorama {

/// Parses one document. `file` is for places and messages only. Throws Error(Config) with
/// `file:line:column: ...` for syntax errors, several documents, duplicate keys, keys that are no
/// text, unknown tags, unknown or endless aliases, nesting deeper than 100 and documents that
/// expand to more than 500 000 values. Anchors, aliases and merge keys (`<<`) are resolved. An
/// empty document is a null value.
Value parse_yaml(std::string_view text, std::string file);

/// Reads and parses a file of at most 64 MiB. Throws Error(Config) when it is missing, not
/// readable, not UTF-8, or when it is not a mapping.
Value read_job_file(const std::filesystem::path& file);

}  // namespace diorama
