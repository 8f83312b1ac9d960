// SPDX-License-Identifier: Apache-2.0
#include "text_scanner.h"

#include <algorithm>
#include <array>

#include "error.h"
#include "path.h"

namespace diorama::usd {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t'; }
bool is_line_end(char c) { return c == '\n' || c == '\r'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

int hex_digit(char c) {
  if (is_digit(c)) return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// The character that the escape at `text[at]` (behind the backslash) stands for; moves `at` on.
char read_escape(std::string_view text, std::size_t& at) {
  const char c = text[at++];
  switch (c) {
    case 'n':
      return '\n';
    case 't':
      return '\t';
    case 'r':
      return '\r';
    case 'a':
      return '\a';
    case 'b':
      return '\b';
    case 'f':
      return '\f';
    case 'v':
      return '\v';
    case 'x': {
      int value = 0;
      for (int i = 0; i < 2 && at < text.size() && hex_digit(text[at]) >= 0; ++i) {
        value = value * 16 + hex_digit(text[at++]);
      }
      return static_cast<char>(value);
    }
    default:
      break;
  }
  if (c < '0' || c > '7') return c;
  int value = c - '0';
  for (int i = 0; i < 2 && at < text.size() && text[at] >= '0' && text[at] <= '7'; ++i) {
    value = value * 8 + (text[at++] - '0');
  }
  return static_cast<char>(value);
}

std::string unescape(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    if (text[at] == '\\' && at + 1 < text.size()) {
      ++at;
      result += read_escape(text, at);
    } else {
      result += text[at++];
    }
  }
  return result;
}

}  // namespace

bool is_keyword(std::string_view word) {
  static constexpr std::array<std::string_view, 55> kKeywords = {"AnimationBlock",
                                                                 "None",
                                                                 "add",
                                                                 "append",
                                                                 "bezier",
                                                                 "class",
                                                                 "config",
                                                                 "connect",
                                                                 "curve",
                                                                 "custom",
                                                                 "customData",
                                                                 "def",
                                                                 "default",
                                                                 "delete",
                                                                 "dictionary",
                                                                 "displayUnit",
                                                                 "doc",
                                                                 "held",
                                                                 "hermite",
                                                                 "inherits",
                                                                 "kind",
                                                                 "linear",
                                                                 "loop",
                                                                 "nameChildren",
                                                                 "none",
                                                                 "offset",
                                                                 "oscillate",
                                                                 "over",
                                                                 "payload",
                                                                 "permission",
                                                                 "post",
                                                                 "pre",
                                                                 "prefixSubstitutions",
                                                                 "prepend",
                                                                 "properties",
                                                                 "references",
                                                                 "rel",
                                                                 "relocates",
                                                                 "reorder",
                                                                 "repeat",
                                                                 "reset",
                                                                 "rootPrims",
                                                                 "scale",
                                                                 "sloped",
                                                                 "specializes",
                                                                 "spline",
                                                                 "subLayers",
                                                                 "suffixSubstitutions",
                                                                 "symmetryArguments",
                                                                 "symmetryFunction",
                                                                 "timeSamples",
                                                                 "uniform",
                                                                 "variantSet",
                                                                 "variantSets",
                                                                 "variants"};
  return word == "varying" || std::binary_search(kKeywords.begin(), kKeywords.end(), word);
}

void TextScanner::fail(const std::string& what) const {
  const std::string_view before = text_.substr(0, std::min(at_, text_.size()));
  const auto line = static_cast<std::size_t>(std::count(before.begin(), before.end(), '\n')) + 1;
  const std::size_t line_start = before.rfind('\n');
  const std::size_t column =
      before.size() - (line_start == std::string_view::npos ? 0 : line_start + 1) + 1;
  throw format_error_at(*file_, what, line, column);
}

bool TextScanner::skip_block_comment() {
  if (!rest().starts_with("/*")) return false;
  const std::size_t end = text_.find("*/", at_ + 2);
  if (end == std::string_view::npos) fail("the comment is not closed with */");
  at_ = end + 2;
  return true;
}

bool TextScanner::skip_line_comment() {
  if (peek() != '#' && !rest().starts_with("//")) return false;
  while (!at_end() && !is_line_end(peek())) ++at_;
  return true;
}

void TextScanner::skip_inline() {
  for (;;) {
    if (is_space(peek())) {
      ++at_;
    } else if (peek() != '/' || !skip_block_comment()) {
      return;
    }
  }
}

void TextScanner::skip_to_line_end() {
  do {
    skip_inline();
  } while (skip_line_comment());
}

void TextScanner::skip_lines() {
  for (;;) {
    if (is_space(peek()) || is_line_end(peek())) {
      ++at_;
    } else if (!skip_line_comment() && !skip_block_comment()) {
      return;
    }
  }
}

void TextScanner::require_space(const char* after) {
  const std::size_t start = at_;
  skip_inline();
  const std::string_view skipped = text_.substr(start, at_ - start);
  if (std::none_of(skipped.begin(), skipped.end(), is_space)) {
    fail(std::string("expected a space after ") + after);
  }
}

bool TextScanner::accept(char c) {
  if (at_end() || text_[at_] != c) return false;
  ++at_;
  return true;
}

void TextScanner::expect(char c, const char* what) {
  if (accept(c)) return;
  const std::string found = at_end() ? "the end of the file" : "'" + std::string(1, peek()) + "'";
  fail(std::string("expected '") + c + "' " + what + ", found " + found);
}

void TextScanner::expect_assignment() {
  skip_inline();
  expect('=', "before the value");
  skip_inline();
}

std::string_view TextScanner::peek_word() const {
  return rest().substr(0, path::identifier_length(rest()));
}

bool TextScanner::accept_word(std::string_view word) {
  if (peek_word() != word) return false;
  at_ += word.size();
  return true;
}

std::string TextScanner::read_string() {
  const char quote = peek();
  const bool is_long = rest().size() >= 3 && text_[at_ + 1] == quote && text_[at_ + 2] == quote;
  const std::size_t mark = is_long ? 3 : 1;
  const std::size_t opening = at_;
  const std::string closing(mark, quote);
  at_ += mark;
  const std::size_t start = at_;
  while (!rest().starts_with(closing)) {
    const bool ends_early = at_end() || (!is_long && is_line_end(peek()));
    if (ends_early) {
      at_ = opening;
      fail("the string is not closed");
    }
    const bool is_escape = peek() == '\\' && at_ + 1 < text_.size() &&
                           (text_[at_ + 1] == '\\' || text_[at_ + 1] == quote);
    at_ += is_escape ? 2 : 1;
  }
  std::string result = unescape(text_.substr(start, at_ - start));
  at_ += mark;
  return result;
}

std::string TextScanner::read_asset() {
  const std::size_t opening = at_;
  const bool is_long = rest().starts_with("@@@");
  at_ += is_long ? 3 : 1;
  std::string result;
  for (;;) {
    if (at_end() || is_line_end(peek())) {
      at_ = opening;
      fail("the asset reference is not closed");
    }
    if (!is_long && accept('@')) return result;
    if (is_long && rest().starts_with("\\@@@")) {
      result += "@@@";
      at_ += 4;
    } else if (is_long && rest().starts_with("@@@")) {
      at_ += 3;
      // Up to two more at signs belong to the path.
      for (int i = 0; i < 2 && peek() == '@'; ++i, ++at_) result += '@';
      return result;
    } else {
      result += text_[at_++];
    }
  }
}

std::string TextScanner::read_path() {
  const std::size_t opening = at_;
  expect('<', "before a path");
  const std::size_t end = text_.find_first_of(">\r\n", at_);
  if (end == std::string_view::npos || text_[end] != '>') {
    at_ = opening;
    fail("the path is not closed with >");
  }
  std::string result(text_.substr(at_, end - at_));
  if (!result.empty() && !path::is_valid(result)) {
    at_ = opening;
    fail("<" + result + "> is not a path");
  }
  at_ = end + 1;
  return result;
}

std::string_view TextScanner::read_number() {
  const std::size_t start = at_;
  const std::string_view all = rest();
  std::size_t i = all.starts_with('-') ? 1 : 0;
  const std::string_view word = all.substr(i, path::identifier_length(all.substr(i)));
  if (word == "inf" || (word == "nan" && i == 0)) {
    at_ += i + 3;
    return text_.substr(start, i + 3);
  }
  const auto at = [&](std::size_t k) { return k < all.size() ? all[k] : '\0'; };
  const std::size_t digits = i;
  while (is_digit(at(i))) ++i;
  const bool has_whole = i > digits;
  if (at(i) == '.' && (has_whole || is_digit(at(i + 1)))) {
    ++i;
    while (is_digit(at(i))) ++i;
  } else if (!has_whole) {
    return {};
  }
  if (at(i) == 'e' || at(i) == 'E') {
    ++i;
    if (at(i) == '+' || at(i) == '-') ++i;
    if (!is_digit(at(i))) fail("the number has no digits in its exponent");
    while (is_digit(at(i))) ++i;
  }
  at_ += i;
  return all.substr(0, i);
}

}  // namespace diorama::usd
