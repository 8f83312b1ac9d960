// SPDX-License-Identifier: Apache-2.0
#include "writer_support/python_json.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "diorama/error.h"

namespace diorama {
namespace {

void append_escape(std::string& out, unsigned unit) {
  std::array<char, 12> text{};
  std::snprintf(text.data(), text.size(), "\\u%04x", unit);
  out += text.data();
}

/// Decodes one UTF-8 sequence and moves `i` behind it.
char32_t next_code_point(const std::string& text, std::size_t& i) {
  const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(text[at]); };
  const unsigned char lead = byte(i);
  const int length = lead < 0x80 ? 1 : lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  static constexpr std::array<char32_t, 5> kSmallest{0, 0, 0x80, 0x800, 0x10000};
  char32_t point = length == 1 ? lead : lead & (0x7Fu >> length);
  bool is_good = (lead < 0x80 || lead >= 0xC0) && lead < 0xF8 && i + length <= text.size();
  for (int k = 1; is_good && k < length; ++k) {
    is_good = (byte(i + k) & 0xC0) == 0x80;
    point = (point << 6) | (byte(i + k) & 0x3Fu);
  }
  is_good = is_good && point >= kSmallest[length] && point <= 0x10FFFF &&
            !(point >= 0xD800 && point < 0xE000);
  if (!is_good) throw Error(ErrorKind::Internal, "'" + text + "': not UTF-8 text");
  i += std::size_t(length);
  return point;
}

void append_text(std::string& out, const std::string& text) {
  out += '"';
  for (std::size_t i = 0; i < text.size();) {
    const char32_t point = next_code_point(text, i);
    switch (point) {
      case U'"':
        out += "\\\"";
        break;
      case U'\\':
        out += "\\\\";
        break;
      case U'\n':
        out += "\\n";
        break;
      case U'\r':
        out += "\\r";
        break;
      case U'\t':
        out += "\\t";
        break;
      case U'\b':
        out += "\\b";
        break;
      case U'\f':
        out += "\\f";
        break;
      default:
        if (point >= 0x20 && point < 0x7F) {
          out += char(point);
        } else if (point < 0x10000) {
          append_escape(out, unsigned(point));
        } else {
          append_escape(out, 0xD800u + unsigned((point - 0x10000) >> 10));
          append_escape(out, 0xDC00u + unsigned((point - 0x10000) & 0x3FFu));
        }
    }
  }
  out += '"';
}

void append_value(std::string& out, const Json& value, int indent, int depth);

void begin_element(std::string& out, bool is_first, int indent, int depth) {
  if (indent < 0) {
    if (!is_first) out += ", ";
    return;
  }
  out += is_first ? "\n" : ",\n";
  out.append(std::size_t(indent * depth), ' ');
}

void end_elements(std::string& out, int indent, int depth) {
  if (indent < 0) return;
  out += '\n';
  out.append(std::size_t(indent * depth), ' ');
}

void append_object(std::string& out, const Json& value, int indent, int depth) {
  if (value.empty()) {
    out += "{}";
    return;
  }
  out += '{';
  bool is_first = true;
  for (const auto& [key, element] : value.items()) {
    begin_element(out, is_first, indent, depth + 1);
    is_first = false;
    append_text(out, key);
    out += ": ";
    append_value(out, element, indent, depth + 1);
  }
  end_elements(out, indent, depth);
  out += '}';
}

void append_array(std::string& out, const Json& value, int indent, int depth) {
  if (value.empty()) {
    out += "[]";
    return;
  }
  out += '[';
  bool is_first = true;
  for (const Json& element : value) {
    begin_element(out, is_first, indent, depth + 1);
    is_first = false;
    append_value(out, element, indent, depth + 1);
  }
  end_elements(out, indent, depth);
  out += ']';
}

void append_value(std::string& out, const Json& value, int indent, int depth) {
  switch (value.type()) {
    case Json::value_t::object:
      return append_object(out, value, indent, depth);
    case Json::value_t::array:
      return append_array(out, value, indent, depth);
    case Json::value_t::string:
      return append_text(out, value.get_ref<const std::string&>());
    case Json::value_t::number_float:
      out += python_float(value.get<double>());
      return;
    default:
      out += value.dump();
      return;
  }
}

}  // namespace

std::string python_float(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "Infinity" : "-Infinity";
  std::array<char, 400> text{};
  const double size = std::abs(value);
  // Python changes to the exponent form below 1e-4 and from 1e16 on.
  const bool has_exponent = size != 0.0 && (size < 1e-4 || size >= 1e16);
  const auto format = has_exponent ? std::chars_format::scientific : std::chars_format::fixed;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value, format).ptr;
  std::string result(text.data(), end);
  if (!has_exponent && result.find('.') == std::string::npos) result += ".0";
  return result;
}

double python_round(double value, int decimals) {
  if (!std::isfinite(value)) return value;
  std::array<char, 400> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  double result = 0.0;
  std::from_chars(text.data(), text.data() + length, result);
  return result;
}

std::string python_json(const Json& value, int indent) {
  std::string out;
  append_value(out, value, indent, 0);
  return out;
}

}  // namespace diorama
