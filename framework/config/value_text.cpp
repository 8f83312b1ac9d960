// SPDX-License-Identifier: Apache-2.0
#include "framework/config/value_text.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "framework/config/clean_text.h"

namespace diorama {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Words and shapes that a YAML reader could take for something else than text.
bool looks_typed(std::string_view text) {
  static constexpr std::array kWords{
      "true", "false", "yes",   "no",   "on",  "off",  "null", "~",   "y",        "n",
      ".inf", "-.inf", "+.inf", ".nan", "inf", "-inf", "+inf", "nan", "infinity", "-infinity"};
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  if (std::find(kWords.begin(), kWords.end(), lower) != kWords.end()) return true;
  const char first = text.front();
  return is_digit(first) || ((first == '-' || first == '+' || first == '.') && text.size() > 1 &&
                             (is_digit(text[1]) || text[1] == '.'));
}

/// Text that stands for itself without quotes, in block and in flow style.
bool is_plain_safe(std::string_view text) {
  if (text.empty() || text.front() == ' ' || text.back() == ' ') return false;
  constexpr std::string_view kInside = "_-./+()<=@ ~^$%;";
  const char first = text.front();
  const bool first_fits = (first >= 'a' && first <= 'z') || (first >= 'A' && first <= 'Z') ||
                          first == '_' || first == '/' || first == '.' || is_digit(first) ||
                          (first == '-' && text.size() > 1 && is_digit(text[1])) ||
                          (first == '+' && text.size() > 1) || (first == '~' && text.size() == 1);
  if (!first_fits || text == "<<") return false;
  return std::all_of(text.begin(), text.end(), [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || is_digit(c) ||
           kInside.find(c) != std::string_view::npos;
  });
}

std::string yaml_text(std::string_view text) {
  if (!text.empty() && is_plain_safe(text) && !looks_typed(text)) return std::string(text);
  return json_quoted(text);
}

std::string yaml_scalar(const Value& value) {
  if (value.kind == Value::Kind::Null) return "null";
  if (value.kind == Value::Kind::List) return "[]";
  if (value.kind == Value::Kind::Map) return "{}";
  if (!value.is_quoted && is_plain_safe(value.scalar)) return value.scalar;
  if (value.is_quoted) return yaml_text(value.scalar);
  // A plain scalar that needs quotes is text whatever we do; none of them reads as a number.
  return json_quoted(value.scalar);
}

bool is_empty(const Value& value) {
  return (value.kind == Value::Kind::List && value.list.empty()) ||
         (value.kind == Value::Kind::Map && value.map.empty());
}
bool is_leaf(const Value& value) {
  return value.kind == Value::Kind::Null || value.kind == Value::Kind::Scalar || is_empty(value);
}

constexpr std::size_t kMaxLine = 88;

std::string flow(const Value& value) {
  if (is_leaf(value)) return yaml_scalar(value);
  std::string text;
  if (value.kind == Value::Kind::List) {
    for (const Value& item : value.list) text += (text.empty() ? "[" : ", ") + flow(item);
    return text + "]";
  }
  for (const auto& [key, item] : value.map) {
    text += (text.empty() ? "{" : ", ") + yaml_text(key) + ": " + flow(item);
  }
  return text + "}";
}

bool is_small(const Value& value, std::size_t indent) {
  if (is_leaf(value)) return true;
  const bool has_only_leaves =
      value.kind == Value::Kind::List &&
      std::all_of(value.list.begin(), value.list.end(), [](const Value& v) { return is_leaf(v); });
  return has_only_leaves && indent + flow(value).size() <= kMaxLine;
}

/// Writes `value` from where the cursor stands in a line; `indent` is where its own lines begin.
void block(const Value& value, std::size_t indent, std::string& text) {
  const std::string margin(indent, ' ');
  bool is_first = true;
  if (value.kind == Value::Kind::List) {
    for (const Value& item : value.list) {
      if (!is_first) text += margin;
      is_first = false;
      text += "- ";
      if (is_small(item, indent + 2)) {
        text += flow(item) + "\n";
      } else {
        block(item, indent + 2, text);
      }
    }
    return;
  }
  for (const auto& [key, item] : value.map) {
    if (!is_first) text += margin;
    is_first = false;
    const std::string name = yaml_text(key);
    text += name + ":";
    if (is_small(item, indent + name.size() + 2)) {
      text += " " + flow(item) + "\n";
    } else {
      text += "\n" + margin + "  ";
      block(item, indent + 2, text);
    }
  }
}

void json(const Value& value, int indent, int depth, std::string& text) {
  const std::string line =
      indent > 0 ? "\n" + std::string(std::size_t(indent * (depth + 1)), ' ') : std::string();
  const std::string end =
      indent > 0 ? "\n" + std::string(std::size_t(indent * depth), ' ') : std::string();
  if (value.kind == Value::Kind::Null) {
    text += "null";
  } else if (value.kind == Value::Kind::Scalar) {
    const bool is_bare = !value.is_quoted && (is_json_number(value.scalar) ||
                                              value.scalar == "true" || value.scalar == "false");
    text += is_bare ? value.scalar : json_quoted(value.scalar);
  } else if (is_empty(value)) {
    text += value.kind == Value::Kind::List ? "[]" : "{}";
  } else if (value.kind == Value::Kind::List) {
    for (std::size_t i = 0; i < value.list.size(); ++i) {
      text += (i == 0 ? "[" : ",") + (i > 0 && indent == 0 ? " " + line : line);
      json(value.list[i], indent, depth + 1, text);
    }
    text += end + "]";
  } else {
    for (std::size_t i = 0; i < value.map.size(); ++i) {
      text += (i == 0 ? "{" : ",") + (i > 0 && indent == 0 ? " " + line : line);
      text += json_quoted(value.map[i].first) + ": ";
      json(value.map[i].second, indent, depth + 1, text);
    }
    text += end + "}";
  }
}

}  // namespace

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

bool is_json_number(std::string_view text) {
  std::size_t i = 0;
  const auto digits = [&] {
    const std::size_t start = i;
    while (i < text.size() && is_digit(text[i])) ++i;
    return i - start;
  };
  if (i < text.size() && text[i] == '-') ++i;
  const std::size_t whole_start = i;
  const std::size_t whole = digits();
  if (whole == 0 || (whole > 1 && text[whole_start] == '0')) return false;
  if (i < text.size() && text[i] == '.') {
    ++i;
    if (digits() == 0) return false;
  }
  if (i < text.size() && (text[i] == 'e' || text[i] == 'E')) {
    ++i;
    if (i < text.size() && (text[i] == '-' || text[i] == '+')) ++i;
    if (digits() == 0) return false;
  }
  return i == text.size();
}

std::string json_quoted(std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string out = "\"";
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const char c = text.front();
    if (length == 0) {
      out += "\xEF\xBF\xBD";
    } else if (c == '"' || c == '\\') {
      (out += '\\') += c;
    } else if (c == '\n') {
      out += "\\n";
    } else if (c == '\t') {
      out += "\\t";
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      ((out += "\\u00") += kHex[std::size_t(c) >> 4]) += kHex[std::size_t(c) & 15];
    } else {
      out += text.substr(0, length);
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return out + '"';
}

std::string to_yaml(const Value& value) {
  if (is_leaf(value)) return yaml_scalar(value) + "\n";
  std::string text;
  block(value, 0, text);
  return text;
}

std::string to_json(const Value& value, int indent) {
  std::string text;
  json(value, indent, 0, text);
  return text;
}

}  // namespace diorama
