// SPDX-License-Identifier: Apache-2.0
#include "path.h"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace diorama::usd::path {
namespace {

// Where the last element begins (at its separator), or npos for "/" and relative single names.
std::size_t last_separator(std::string_view path) {
  if (path.empty()) return std::string_view::npos;
  if (path.back() == '}') return path.rfind('{');
  if (path.back() == ']') return path.rfind('[');
  for (std::size_t i = path.size(); i-- > 0;) {
    const char c = path[i];
    if (c == '/' || c == '.') return i;
    if (c == '}' || c == ']') return i + 1;
  }
  return std::string_view::npos;
}

// Decodes one code point; 0 when the bytes are not UTF-8.
std::uint32_t next_code_point(std::string_view text, std::size_t& at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(at);
  if (lead < 0x80) return text[at++];
  const int more = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : lead >= 0xC2 ? 1 : 0;
  if (more == 0 || lead > 0xF4 || at + more >= text.size()) return 0;
  std::uint32_t code = lead & (0x3Fu >> more);
  for (int i = 1; i <= more; ++i) {
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
    code = (code << 6) | (byte(at + i) & 0x3Fu);
  }
  at += more + 1;
  return code;
}

bool is_ascii_word(std::uint32_t c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

// Letters and digits of Unicode by their big blocks: symbols, punctuation and spaces are the ranges
// left out. The full identifier tables would be two thousand ranges.
bool is_unicode_word(std::uint32_t c) {
  if (c < 0xAA || c == 0xAB || c == 0xAC || c == 0xAE || c == 0xAF || c == 0xD7 || c == 0xF7) {
    return false;
  }
  if (c >= 0xB0 && c < 0xC0) return c == 0xB5 || c == 0xB7 || c == 0xBA;
  if (c >= 0x2000 && c < 0x2071) return c == 0x203F || c == 0x2040 || c == 0x2054;
  if (c >= 0x20A0 && c < 0x20D0) return false;
  if (c >= 0x2190 && c < 0x2C00) return false;
  if (c >= 0x2E00 && c < 0x3005) return c == 0x2E2F;
  if (c >= 0x3008 && c < 0x3021) return false;
  if (c >= 0xD800 && c < 0xF900) return false;
  if (c >= 0xFE10 && c < 0xFE20) return false;
  if (c >= 0xFE30 && c < 0xFE70) return c == 0xFE33 || c == 0xFE34;
  if (c >= 0x1F000 && c < 0x20000) return false;
  return c <= 0x323AF || (c >= 0xE0100 && c <= 0xE01EF);
}

// Digits and combining marks of the common blocks may not begin an identifier.
bool is_unicode_continue_only(std::uint32_t c) {
  return c == 0xB7 || (c >= 0x300 && c < 0x370) || (c >= 0x660 && c < 0x66A) ||
         (c >= 0x966 && c < 0x970) || (c >= 0x9E6 && c < 0x9F0) || (c >= 0x200C && c < 0x2041) ||
         (c >= 0x20D0 && c < 0x2100) || (c >= 0xFE00 && c < 0xFE30) || (c >= 0xFF10 && c < 0xFF1A);
}

// Consumes `{set=variant}`; false when malformed.
bool skip_variant(std::string_view& text) {
  const std::size_t close = text.find('}');
  if (close == std::string_view::npos) return false;
  const std::string_view inside = text.substr(1, close - 1);
  const std::size_t equals = inside.find('=');
  if (equals == std::string_view::npos) return false;
  const auto trim = [](std::string_view s) {
    while (!s.empty() && (s.front() == ' ' || s.front() == '\t')) s.remove_prefix(1);
    while (!s.empty() && (s.back() == ' ' || s.back() == '\t')) s.remove_suffix(1);
    return s;
  };
  const std::string_view set = trim(inside.substr(0, equals));
  const std::string_view variant = trim(inside.substr(equals + 1));
  if (!is_identifier(set) || !(variant.empty() || is_variant_name(variant))) return false;
  text.remove_prefix(close + 1);
  return true;
}

bool is_valid_at_depth(std::string_view text, int nesting);

// Consumes what may follow a property's dot: a namespaced name, then targets and more properties.
bool is_valid_property(std::string_view text, int nesting) {
  for (;;) {
    std::size_t length = identifier_length(text);
    if (length == 0) return false;
    while (length < text.size() && text[length] == ':') {
      const std::size_t more = identifier_length(text.substr(length + 1));
      if (more == 0) return false;
      length += 1 + more;
    }
    text.remove_prefix(length);
    if (text.empty()) return true;
    if (text.front() == '[') {
      const std::size_t close = text.rfind(']');
      if (close == std::string_view::npos) return false;
      if (!is_valid_at_depth(text.substr(1, close - 1), nesting + 1)) return false;
      text.remove_prefix(close + 1);
      if (text.empty()) return true;
    }
    if (text.front() != '.') return false;
    text.remove_prefix(1);
  }
}

bool is_valid_at_depth(std::string_view text, int nesting) {
  if (text.empty() || nesting > 8) return false;
  if (text == "/" || text == "." || text == "..") return true;
  if (text.front() == '/') {
    text.remove_prefix(1);
  } else {
    while (text.starts_with("../")) text.remove_prefix(3);
    if (text == "..") return true;
    if (text.starts_with("...")) return false;
    if (text.starts_with("..") && text.size() > 2 && text[2] == '.') {
      return is_valid_property(text.substr(3), nesting);
    }
    if (text.front() == '.') return is_valid_property(text.substr(1), nesting);
  }
  for (bool is_after_variant = false;;) {
    const std::size_t length = identifier_length(text);
    if (length == 0 && !is_after_variant) return false;
    text.remove_prefix(length);
    is_after_variant = false;
    while (!text.empty() && text.front() == '{') {
      if (!skip_variant(text)) return false;
      is_after_variant = true;
    }
    if (text.empty()) return true;
    if (text.front() == '.') return is_valid_property(text.substr(1), nesting);
    if (text.front() == '/') {
      text.remove_prefix(1);
      is_after_variant = false;
    } else if (!is_after_variant) {
      return false;
    }
  }
}

}  // namespace

std::size_t identifier_length(std::string_view text) {
  std::size_t at = 0;
  while (at < text.size()) {
    std::size_t next = at;
    const std::uint32_t c = next_code_point(text, next);
    const bool is_first = at == 0;
    if (c < 0x80) {
      if (!is_ascii_word(c) || (is_first && c >= '0' && c <= '9')) break;
    } else if (!is_unicode_word(c) || (is_first && is_unicode_continue_only(c))) {
      break;
    }
    at = next;
  }
  return at;
}

std::string_view parent(std::string_view path) {
  if (path.empty() || path == "/") return {};
  const std::size_t at = last_separator(path);
  if (at == std::string_view::npos) return {};
  if (at == 0) return path.substr(0, 1);
  return path.substr(0, at);
}

std::string_view name(std::string_view path) {
  const std::size_t at = last_separator(path);
  if (at == std::string_view::npos) return path;
  const char c = path[at];
  return path.substr(c == '/' || c == '.' ? at + 1 : at);
}

std::string_view prim_part(std::string_view path) {
  const std::string_view property = property_part(path);
  if (property.empty()) return path;
  return path.substr(0, property.data() - path.data() - 1);
}

std::string_view property_part(std::string_view path) {
  std::size_t i = 0;
  while (path.substr(i).starts_with("..")) i += path.substr(i).starts_with("../") ? 3 : 2;
  // Names of variants may hold dots, so look outside braces only.
  for (int braces = 0; i < path.size(); ++i) {
    if (path[i] == '{') ++braces;
    if (path[i] == '}') --braces;
    if (path[i] == '.' && braces == 0) return path.substr(i + 1);
  }
  return {};
}

std::string append_child(std::string_view path, std::string_view name) {
  std::string result(path);
  if (!path.ends_with('/') && !path.ends_with('}')) result += '/';
  return result += name;
}

std::string append_property(std::string_view path, std::string_view name) {
  std::string result(path);
  result += '.';
  return result += name;
}

std::string append_variant(std::string_view path, std::string_view set, std::string_view variant) {
  std::string result(path);
  result += '{';
  result += set;
  result += '=';
  result += variant;
  return result += '}';
}

bool has_prefix(std::string_view path, std::string_view prefix) {
  if (prefix == "/") return path.starts_with('/');
  if (!path.starts_with(prefix)) return false;
  if (path.size() == prefix.size() || prefix.ends_with('}')) return true;
  const char next = path[prefix.size()];
  return next == '/' || next == '.' || next == '{' || next == '[';
}

std::string replace_prefix(std::string_view path, std::string_view from, std::string_view to) {
  if (from == to) return std::string(path);
  std::string_view rest = path.substr(from.size());
  if (rest.empty()) return std::string(to);
  if (from == "/" && path == "/") return std::string(to);
  const bool is_child =
      rest.front() == '/' || (rest.front() != '.' && rest.front() != '{' && rest.front() != '[');
  if (!is_child) return std::string(to == "/" ? std::string_view("/") : to).append(rest);
  if (rest.front() == '/') rest.remove_prefix(1);
  return append_child(to, rest);
}

bool has_variants(std::string_view path) { return path.find('{') != std::string_view::npos; }

std::string strip_variants(std::string_view path) {
  if (!has_variants(path)) return std::string(path);
  std::string result;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i] != '{') {
      result += path[i];
      continue;
    }
    i = std::min(path.find('}', i), path.size() - 1);
    const bool is_child_next =
        i + 1 < path.size() && path[i + 1] != '{' && path[i + 1] != '.' && path[i + 1] != '/';
    if (is_child_next) result += '/';
  }
  return result;
}

bool is_variant(std::string_view path) { return path.ends_with('}'); }

std::pair<std::string, std::string> variant_selection(std::string_view path) {
  std::string_view inside = name(path);
  inside = inside.substr(1, inside.size() - 2);
  const std::size_t equals = inside.find('=');
  return {std::string(inside.substr(0, equals)), std::string(inside.substr(equals + 1))};
}

int depth(std::string_view path) {
  const std::string plain = strip_variants(prim_part(path));
  if (plain == "/") return 0;
  return static_cast<int>(std::count(plain.begin(), plain.end(), '/'));
}

bool is_root_prim(std::string_view path) {
  return path.size() > 1 && path.rfind('/') == 0 && path.find_first_of(".{[") == path.npos;
}

std::string make_absolute(std::string_view path, std::string_view anchor) {
  if (path.starts_with('/')) return std::string(path);
  std::string base(anchor);
  while (path.starts_with("..")) {
    // Leaving a variant leaves its prim as well.
    while (is_variant(base)) base = parent(base);
    if (base == "/" || base.empty()) return {};
    base = parent(base);
    path.remove_prefix(2);
    if (path.starts_with('/')) path.remove_prefix(1);
  }
  if (path == ".") path = {};
  if (path.empty()) return base;
  if (path.front() == '.') return base + std::string(path);
  return append_child(base, path);
}

bool is_identifier(std::string_view name) {
  return !name.empty() && identifier_length(name) == name.size();
}

bool is_namespaced_identifier(std::string_view name) {
  for (;;) {
    const std::size_t colon = name.find(':');
    if (!is_identifier(name.substr(0, colon))) return false;
    if (colon == std::string_view::npos) return true;
    name.remove_prefix(colon + 1);
  }
}

bool is_variant_name(std::string_view name) {
  if (name.starts_with('.')) name.remove_prefix(1);
  if (name.empty()) return false;
  for (std::size_t at = 0; at < name.size();) {
    const std::uint32_t c = next_code_point(name, at);
    if (c == 0) return false;
    if (c < 0x80 ? !(is_ascii_word(c) || c == '|' || c == '-') : !is_unicode_word(c)) return false;
  }
  return true;
}

bool is_valid(std::string_view path) { return is_valid_at_depth(path, 0); }

bool is_prim_path(std::string_view path) {
  return is_valid(path) && path != "/" && !has_variants(path) && property_part(path).empty();
}

}  // namespace diorama::usd::path
