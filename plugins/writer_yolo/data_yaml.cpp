// SPDX-License-Identifier: Apache-2.0
#include "writer_yolo/data_yaml.h"

#include <set>
#include <stdexcept>

#include "reader_support/label_text.h"

namespace diorama {
namespace {

/// A key's value: a scalar, or what a list or map holds, keys of lists being 0, 1, 2 ...
struct YamlNode {
  std::string scalar;
  std::vector<std::pair<std::string, std::string>> items;
  bool is_collection = false;
};

struct Line {
  std::size_t number = 0;
  std::size_t indent = 0;
  std::string text;
};

[[noreturn]] void refuse(std::size_t line, const std::string& why) {
  throw std::runtime_error("line " + std::to_string(line) + ": " + why);
}

std::string trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == text.npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t") - first + 1));
}

/// Without a comment, which begins at the line's start or behind a blank, outside of quotes.
std::string without_comment(std::string_view text) {
  char quote = '\0';
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quote != '\0') {
      if (c == '\\' && quote == '"') ++i;
      if (c == quote) quote = '\0';
    } else if ((c == '"' || c == '\'') &&
               (i == 0 || std::string_view(" [{,:").find(text[i - 1]) != std::string_view::npos)) {
      quote = c;
    } else if (c == '#' && (i == 0 || text[i - 1] == ' ' || text[i - 1] == '\t')) {
      return std::string(text.substr(0, i));
    }
  }
  return std::string(text);
}

void append_utf8(std::string& text, unsigned code) {
  if (code < 0x80) {
    text += char(code);
  } else if (code < 0x800) {
    text += char(0xC0 | code >> 6);
    text += char(0x80 | (code & 0x3F));
  } else if (code < 0x10000) {
    text += char(0xE0 | code >> 12);
    text += char(0x80 | (code >> 6 & 0x3F));
    text += char(0x80 | (code & 0x3F));
  } else {
    text += char(0xF0 | code >> 18);
    text += char(0x80 | (code >> 12 & 0x3F));
    text += char(0x80 | (code >> 6 & 0x3F));
    text += char(0x80 | (code & 0x3F));
  }
}

/// Walks through a scalar or a flow collection.
class Flow {
 public:
  Flow(std::string_view text, std::size_t line) : text_(text), line_(line) {}

  YamlNode value() {
    YamlNode node;
    skip();
    if (accept('[')) {
      node.is_collection = true;
      while (!accept(']')) {
        node.items.emplace_back(std::to_string(node.items.size()), scalar(",]"));
        if (!accept(',') && peek() != ']') refuse(line_, "a list does not end with ']'");
      }
    } else if (accept('{')) {
      node.is_collection = true;
      while (!accept('}')) {
        std::string key = scalar(":}");
        if (!accept(':')) refuse(line_, "a map lacks a ':'");
        node.items.emplace_back(std::move(key), scalar(",}"));
        if (!accept(',') && peek() != '}') refuse(line_, "a map does not end with '}'");
      }
    } else {
      node.scalar = scalar("");
    }
    skip();
    if (!text_.empty()) refuse(line_, "'" + std::string(text_) + "' stands behind a value");
    return node;
  }

  std::string scalar(std::string_view ends) {
    skip();
    if (peek() == '"' || peek() == '\'') return quoted();
    std::size_t end = 0;
    while (end < text_.size() && ends.find(text_[end]) == ends.npos) ++end;
    std::string result = trimmed(text_.substr(0, end));
    text_.remove_prefix(end);
    return result;
  }

 private:
  void skip() {
    while (!text_.empty() && (text_.front() == ' ' || text_.front() == '\t'))
      text_.remove_prefix(1);
  }
  char peek() {
    skip();
    return text_.empty() ? '\0' : text_.front();
  }
  bool accept(char c) {
    if (peek() != c) return false;
    text_.remove_prefix(1);
    return true;
  }

  std::string quoted() {
    const char quote = text_.front();
    text_.remove_prefix(1);
    std::string result;
    while (true) {
      if (text_.empty()) refuse(line_, "a quoted text does not end");
      const char c = text_.front();
      text_.remove_prefix(1);
      if (c == quote && quote == '\'' && text_.starts_with('\'')) {
        result += '\'';
        text_.remove_prefix(1);
      } else if (c == quote) {
        return result;
      } else if (c == '\\' && quote == '"') {
        escape(result);
      } else {
        result += c;
      }
    }
  }

  unsigned code(std::size_t digits) {
    if (text_.size() < digits) refuse(line_, "an escape is cut short");
    unsigned value = 0;
    for (std::size_t i = 0; i < digits; ++i) {
      const char c = text_[i];
      const int digit = c >= '0' && c <= '9'   ? c - '0'
                        : c >= 'a' && c <= 'f' ? c - 'a' + 10
                        : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                               : -1;
      if (digit < 0) refuse(line_, "an escape is none");
      value = value << 4 | unsigned(digit);
    }
    text_.remove_prefix(digits);
    return value;
  }

  void escape(std::string& result) {
    const char c = text_.empty() ? '\0' : text_.front();
    if (!text_.empty()) text_.remove_prefix(1);
    if (c == 'u') {
      unsigned value = code(4);
      // JSON texts write what lies above 16 bits as a pair.
      if (value >= 0xD800 && value < 0xDC00 && text_.starts_with("\\u")) {
        text_.remove_prefix(2);
        value = 0x10000 + ((value - 0xD800) << 10) + ((code(4) - 0xDC00) & 0x3FF);
      }
      append_utf8(result, value);
    } else if (c == 'x') {
      append_utf8(result, code(2));
    } else if (c == 'n') {
      result += '\n';
    } else if (c == 't') {
      result += '\t';
    } else {
      result += c;
    }
  }

  std::string_view text_;
  std::size_t line_;
};

std::vector<Line> lines_with_text(std::string_view text) {
  std::vector<Line> lines;
  std::size_t number = 0;
  for (const std::string& line : text_lines(text)) {
    ++number;
    const std::string bare = without_comment(line);
    if (trimmed(bare).empty() || bare.starts_with("---") || bare.starts_with("...")) continue;
    lines.push_back({number, bare.find_first_not_of(" \t"), trimmed(bare)});
  }
  return lines;
}

std::size_t open_brackets(const std::string& text) {
  std::size_t open = 0;
  for (const char c : text) {
    if (c == '[' || c == '{') ++open;
    if ((c == ']' || c == '}') && open > 0) --open;
  }
  return open;
}

/// Where a key ends; npos when the line has none.
std::size_t key_end(const std::string& text) {
  std::size_t at = 0;
  if (text.starts_with('"') || text.starts_with('\'')) {
    at = text.find(text[0], 1);
    if (at == text.npos) return at;
  }
  for (at = text.find(':', at); at != text.npos; at = text.find(':', at + 1)) {
    if (at + 1 == text.size() || text[at + 1] == ' ') return at;
  }
  return text.npos;
}

/// The value that stands behind a key and on the deeper lines that follow.
YamlNode value_of(const std::vector<Line>& lines, std::size_t& at, const std::string& rest) {
  const Line& line = lines[at];
  if (!rest.empty()) {
    std::string text = rest;
    while (open_brackets(text) > 0 && at + 1 < lines.size()) text += " " + lines[++at].text;
    return Flow(text, line.number).value();
  }
  YamlNode node;
  node.is_collection = true;
  while (at + 1 < lines.size()) {
    const Line& next = lines[at + 1];
    const bool is_item = next.text == "-" || next.text.starts_with("- ");
    if (next.indent < line.indent + (is_item ? 0 : 1)) break;
    ++at;
    if (is_item) {
      node.items.emplace_back(std::to_string(node.items.size()),
                              Flow(next.text.substr(1), next.number).value().scalar);
      continue;
    }
    const std::size_t end = key_end(next.text);
    // Keys of deeper maps mean nothing here.
    if (end == next.text.npos) continue;
    node.items.emplace_back(Flow(next.text.substr(0, end), next.number).scalar(""),
                            Flow(next.text.substr(end + 1), next.number).value().scalar);
  }
  return node;
}

}  // namespace

DataYaml parse_data_yaml(std::string_view text) {
  const std::vector<Line> lines = lines_with_text(text);
  DataYaml yaml;
  std::set<std::string> keys;
  for (std::size_t at = 0; at < lines.size(); ++at) {
    const Line& line = lines[at];
    if (line.indent > 0) continue;
    const std::size_t end = key_end(line.text);
    if (end == line.text.npos) refuse(line.number, "'" + line.text + "' is no key with a value");
    const std::string key = Flow(line.text.substr(0, end), line.number).scalar("");
    const bool is_known = key == "path" || key == "train" || key == "val" || key == "valid" ||
                          key == "test" || key == "names" || key == "kpt_shape" || key == "nc";
    if (!is_known) continue;
    if (!keys.insert(key).second) refuse(line.number, "'" + key + "' is there twice");
    const YamlNode node = value_of(lines, at, trimmed(line.text.substr(end + 1)));
    try {
      if (key == "path") {
        yaml.path = node.scalar;
      } else if (key == "nc") {
        yaml.nc = integer_of(node.scalar);
      } else if (key == "names") {
        for (const auto& [id, name] : node.items) {
          if (!yaml.names.emplace(integer_of(id), name).second) {
            refuse(line.number, "the class " + id + " is there twice");
          }
        }
      } else if (key == "kpt_shape") {
        for (const auto& [place, count] : node.items) yaml.kpt_shape.push_back(integer_of(count));
      } else {
        std::vector<std::string>& places = yaml.splits[key == "valid" ? "val" : key];
        if (!node.scalar.empty()) places.push_back(node.scalar);
        for (const auto& [place, folder] : node.items) places.push_back(folder);
      }
    } catch (const std::runtime_error& error) {
      refuse(line.number, error.what());
    }
  }
  return yaml;
}

}  // namespace diorama
