// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/params.h"

/// Declared parameters as words, for `diorama plugins describe` and the reference pages.
namespace diorama {

/// One line of a parameter table.
struct ParamRow {
  std::string key;            ///< "noise.sigma", "layers[].name".
  std::string type;           ///< "integer", "[lo, hi]", "one of: a, b".
  std::string default_value;  ///< YAML; empty for groups and lists of mappings.
  std::string range;          ///< ">= 0", "0 to 1"; empty: any.
  std::string unit;
  std::string help;
};

/// Groups and lists are followed by what they hold.
std::vector<ParamRow> param_rows(const std::vector<ParamSpec>& specs);

/// "boolean", "integer", "text or null" ...
std::string type_text(const ParamSpec& spec);
/// ">= 0", "<= 1", "0 to 1", or nothing.
std::string range_text(const ParamSpec& spec);

/// The same for programs: a list of mappings.
Value param_values(const std::vector<ParamSpec>& specs);

}  // namespace diorama
