// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "diorama/config.h"

/// Value trees as text.
namespace diorama {

/// Block style with two spaces of indentation; reading it back gives the same tree (places aside).
/// Lists of scalars and small mappings inside lists stay on one line.
std::string to_yaml(const Value& value);

/// `indent` spaces per level; 0: one line. Plain scalars that JSON knows (numbers, true, false)
/// stay what they are, all others become strings.
std::string to_json(const Value& value, int indent);

/// The text as a JSON string literal with quotes. Bytes that are not UTF-8 become U+FFFD.
std::string json_quoted(std::string_view text);

/// "0.5", "30", "1e+06": six digits at most.
std::string short_number(double value);

/// True when a plain scalar reads as a JSON number: `-1.5e3`, not `012`, `.5`, `0x10` or `nan`.
bool is_json_number(std::string_view text);

}  // namespace diorama
