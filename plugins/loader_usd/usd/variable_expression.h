// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "value.h"

namespace diorama::usd {

/// True for text between backquotes, which stands for what it evaluates to.
bool is_expression(std::string_view text);

/// Evaluates an expression to text: quoted strings with `${NAME}`, names, and the functions if,
/// and, or, not, eq, neq, lt, leq, gt, geq, contains, at, len and defined. Nothing when it is
/// malformed, names a missing variable or gives something else than text; the empty text for
/// `None`.
std::optional<std::string> evaluate_expression(std::string_view text, const Dictionary& variables);

}  // namespace diorama::usd
