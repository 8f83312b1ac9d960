// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace diorama {

/// Where a syntax error really is, and what is wrong in words that a writer of YAML knows.
struct YamlFault {
  int line = 0;  ///< From 1, as `column`.
  int column = 0;
  std::string message;
};

/// `message` is the parser's, for the place where it gave up; `text` is the whole document.
YamlFault explain_yaml_fault(std::string_view text, int line, int column, std::string_view message);

/// The bracket that is still open at the end of a document, which the parser may take for a key.
std::optional<YamlFault> unclosed_bracket(std::string_view text);

}  // namespace diorama
