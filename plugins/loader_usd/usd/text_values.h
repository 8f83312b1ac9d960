// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "text_scanner.h"
#include "types.h"
#include "value.h"

namespace diorama::usd {

/// Reads a value of the given type: a number, a string, a tuple or a list. A type that USD does not
/// know is read and forgotten. Throws FormatError.
Value read_text_value(TextScanner& scanner, const ValueTypeName& type);

/// `{ type name = value ... }`. Throws FormatError.
std::shared_ptr<const Dictionary> read_text_dictionary(TextScanner& scanner);

/// Skips any value: of a metadata field that no schema describes.
void skip_text_value(TextScanner& scanner);

/// The number that `digits` (from TextScanner::read_number) spells.
double parse_number(std::string_view digits);

}  // namespace diorama::usd
