// SPDX-License-Identifier: Apache-2.0
#include "framework/config/yaml_faults.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace diorama {
namespace {

using Lines = std::vector<std::string_view>;

Lines lines_of(std::string_view text) {
  Lines lines;
  for (std::size_t start = 0; start <= text.size();) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    std::string_view line = text.substr(start, end - start);
    if (line.ends_with('\r')) line.remove_suffix(1);
    lines.push_back(line);
    start = end + 1;
  }
  return lines;
}

std::size_t indentation(std::string_view line) {
  return std::min(line.find_first_not_of(" \t"), line.size());
}

bool is_empty(std::string_view line) {
  const std::size_t start = indentation(line);
  return start == line.size() || line[start] == '#';
}

/// The line without its comment. Quotes are looked at, escapes in them are not.
std::string_view without_comment(std::string_view line) {
  char quote = '\0';
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (quote != '\0') {
      if (line[i] == quote) quote = '\0';
    } else if (line[i] == '"' || line[i] == '\'') {
      quote = line[i];
    } else if (line[i] == '#' && (i == 0 || line[i - 1] == ' ')) {
      return line.substr(0, i);
    }
  }
  return line;
}

/// The bracket that is still open where the parser gave up.
std::optional<YamlFault> open_bracket(const Lines& lines, std::size_t line, std::size_t column) {
  std::vector<YamlFault> open;
  for (std::size_t y = 0; y <= line && y < lines.size(); ++y) {
    const std::string_view text = without_comment(lines[y]);
    const std::size_t end = y == line ? std::min(column, text.size()) : text.size();
    char quote = '\0';
    for (std::size_t x = 0; x < end; ++x) {
      const char c = text[x];
      if (quote != '\0') {
        if (c == quote) quote = '\0';
      } else if (c == '"' || c == '\'') {
        quote = c;
      } else if (c == '[' || c == '{') {
        open.push_back({int(y) + 1, int(x) + 1, std::string(1, c)});
      } else if ((c == ']' || c == '}') && !open.empty()) {
        open.pop_back();
      }
    }
  }
  if (open.empty()) return std::nullopt;
  return open.back();
}

std::optional<YamlFault> tab_in_indentation(const Lines& lines, std::size_t line) {
  // The line itself, or the one above it, whose tab the parser took for a part of its text.
  for (const std::size_t y : {line, line - 1}) {
    if (y >= lines.size() || is_empty(lines[y])) continue;
    const std::size_t tab = lines[y].substr(0, indentation(lines[y])).find('\t');
    if (tab == std::string_view::npos) continue;
    return YamlFault{int(y) + 1, int(tab) + 1,
                     "a tab indents this line; YAML is indented by spaces alone"};
  }
  return std::nullopt;
}

std::string spaces(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " space" : " spaces");
}

/// Columns at which the values around a line begin: the indentations of the lines above it, from
/// the nearest outwards.
std::vector<std::size_t> levels_above(const Lines& lines, std::size_t line) {
  std::vector<std::size_t> levels;
  for (std::size_t y = line; y-- > 0;) {
    if (is_empty(lines[y])) continue;
    const std::size_t at = indentation(lines[y]);
    if (levels.empty() || at < levels.back()) levels.push_back(at);
    if (at == 0) break;
  }
  return levels;
}

/// A line that begins at a column where nothing above it does.
std::optional<YamlFault> wrong_indentation(const Lines& lines, std::size_t line) {
  if (line >= lines.size() || is_empty(lines[line])) return std::nullopt;
  const std::size_t at = indentation(lines[line]);
  const std::vector<std::size_t> levels = levels_above(lines, line);
  if (levels.empty() || std::find(levels.begin(), levels.end(), at) != levels.end()) {
    return std::nullopt;
  }
  std::string known;
  for (std::size_t i = levels.size(); i-- > 0;) {
    known += (known.empty() ? "" : i == 0 ? " or " : ", ") + std::to_string(levels[i]);
  }
  return YamlFault{int(line) + 1, int(at) + 1,
                   "this line is indented by " + spaces(at) +
                       ", the lines that it could belong to "
                       "by " +
                       known + "; lines of one mapping or list begin in one column"};
}

bool has_key(std::string_view line) {
  line = without_comment(line);
  while (line.ends_with(' ')) line.remove_suffix(1);
  return line.ends_with(':') || line.find(": ") != std::string_view::npos;
}

/// Why a colon stands where no key can be.
YamlFault misplaced_key(const Lines& lines, std::size_t line, std::size_t column) {
  const std::string_view text = line < lines.size() ? lines[line] : std::string_view();
  const std::string_view before = text.substr(0, std::min(column, text.size()));
  if (before.find(": ") != std::string_view::npos) {
    return {
        int(line) + 1, int(column) + 1,
        "a second 'key: value' in one line; put the value in quotes if the colon belongs to it"};
  }
  for (std::size_t y = line; y-- > 0;) {
    if (is_empty(lines[y])) continue;
    if (!has_key(lines[y])) {
      return {int(y) + 1, int(indentation(lines[y])) + 1,
              "this line is no 'key: value'; is the colon missing, or the space behind it?"};
    }
    if (indentation(lines[y]) < indentation(text)) {
      return {int(line) + 1, int(indentation(text)) + 1,
              "this line is indented deeper than line " + std::to_string(y + 1) +
                  ", which has a value already"};
    }
    break;
  }
  return {int(line) + 1, int(column) + 1, "no 'key: value' can stand here"};
}

YamlFault unclosed(const Lines& lines, std::size_t line, std::size_t column) {
  const auto open = open_bracket(lines, line, column);
  const std::string where = std::to_string(line + 1) + ":" + std::to_string(column + 1);
  if (!open) {
    return {int(line) + 1, int(column) + 1, "a comma or the closing bracket is missing here"};
  }
  return {open->line, open->column,
          "the '" + open->message +
              "' that opens here is not closed, or a comma is missing, before " + where};
}

/// What needs no look at the document.
std::string plain_words(std::string_view message) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 17> kWords{{
      {"illegal flow end", "this bracket closes nothing that is open"},
      {"illegal block entry",
       "a list entry '- ' cannot begin here; it begins a line, or follows another '- '"},
      {"illegal map key", "'? ' cannot begin a key here"},
      {"the referenced anchor is not defined",
       "no '&anchor' of this name stands before the alias; put text that begins with '*' in "
       "quotes"},
      {"alias not found after *",
       "a name is missing behind '*'; put text that begins with it in quotes"},
      {"anchor not found after &",
       "a name is missing behind '&'; put text that begins with it in quotes"},
      {"unknown token", "no value begins with this character; put it in quotes"},
      {"unknown escape character",
       "no such escape in double quotes; write '\\\\' for a backslash, or use single quotes"},
      {"bad character found while scanning hex number",
       "the digits behind '\\x', '\\u' or '\\U' are 0-9 and a-f"},
      {"invalid unicode", "this escape stands for no character"},
      {"cannot assign multiple", "one value has one tag, one anchor or one alias"},
      {"aliases can't have any content", "an alias stands for its value alone"},
      {"illegal EOF in scalar", "the quotes are not closed before the end of the file"},
      {"illegal document indicator in scalar", "the quotes are not closed before this line"},
      {"cannot set zero indentation", "the number behind '|' or '>' is 1 to 9"},
      {"unexpected character in block scalar",
       "only '+', '-' or a digit may follow '|' or '>'; the text begins in the next line"},
      {"YAML", "this directive is not understood; leave out lines that begin with '%'"},
  }};
  for (const auto& [theirs, ours] : kWords) {
    if (message.starts_with(theirs)) return std::string(ours);
  }
  return "this is not understood; is a value with special characters to be put in quotes?";
}

}  // namespace

YamlFault explain_yaml_fault(std::string_view text, int line_from_1, int column_from_1,
                             std::string_view message) {
  const Lines lines = lines_of(text);
  const auto line = std::size_t(std::max(line_from_1 - 1, 0));
  const auto column = std::size_t(std::max(column_from_1 - 1, 0));
  if (auto fault = tab_in_indentation(lines, line)) return *fault;
  const bool is_flow = message == "end of sequence flow not found" ||  //
                       message == "end of map flow not found";
  if (is_flow) return unclosed(lines, line, column);
  if (message == "end of map not found" || message == "end of sequence not found") {
    if (auto fault = wrong_indentation(lines, line)) return *fault;
    const bool is_entry =
        line < lines.size() && lines[line].substr(indentation(lines[line])).starts_with("- ");
    return {line_from_1, column_from_1,
            is_entry ? "a list entry stands where a 'key: value' of the mapping above belongs"
                     : "something follows a value that is at its end; put the whole in quotes"};
  }
  if (message == "illegal map value") return misplaced_key(lines, line, column);
  return {line_from_1, column_from_1, plain_words(message)};
}

std::optional<YamlFault> unclosed_bracket(std::string_view text) {
  const Lines lines = lines_of(text);
  const std::size_t last = lines.size() - 1;
  if (!open_bracket(lines, last, lines[last].size())) return std::nullopt;
  return unclosed(lines, last, lines[last].size());
}

}  // namespace diorama
