// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace diorama {

/// Where the text of a value stands in a file.
struct JsonSpan {
  std::uint64_t offset = 0;
  std::uint32_t length = 0;
};

/// Walks through a file that holds one JSON object, however large, with one value in memory at a
/// time. `visit(key, is_element, span, text)` is called for each value of the object; a list gives
/// each of its elements instead (is_element), an empty one "[]" as a value. Texts are cut out by
/// their brackets and quotes, and left to the caller to parse. Throws std::runtime_error: no
/// object, cut short, a value above 1 GiB.
using JsonVisitor = std::function<void(const std::string& key, bool is_element, JsonSpan span,
                                       std::string_view text)>;
void visit_json_file(const std::filesystem::path& file, const JsonVisitor& visit);

/// The text of a span. Throws std::runtime_error when the file has become shorter.
std::string read_span(const std::filesystem::path& file, JsonSpan span);

}  // namespace diorama
