// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/label_pattern.h"

#include <re2/re2.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "diorama/error.h"
#include "framework/config/clean_text.h"

namespace diorama {
namespace {

using Groups = std::vector<re2::StringPiece>;

RE2::Options options() {
  RE2::Options options;
  options.set_log_errors(false);
  return options;
}

std::string fault_in(const RE2& regex) {
  const std::string part(regex.error_arg());
  const std::string found = part.empty() ? "" : ", found '" + part + "'";
  const bool is_reference = regex.error_code() == RE2::ErrorBadEscape && part.size() == 2 &&
                            part[1] >= '1' && part[1] <= '9';
  if (is_reference) {
    return "back references are not supported" + found + "; write the repeated part out";
  }
  const bool looks_around = part.starts_with("(?=") || part.starts_with("(?!") ||
                            part.starts_with("(?<=") || part.starts_with("(?<!");
  if (looks_around || (regex.error_code() == RE2::ErrorBadPerlOp && part.starts_with("(?<"))) {
    return "looking ahead and behind is not supported" + found +
           "; match the neighbouring text and put it back by '$1'";
  }
  switch (regex.error_code()) {
    case RE2::ErrorMissingBracket:
      return "a '[' is not closed" + found;
    case RE2::ErrorMissingParen:
      return "a '(' is not closed" + found;
    case RE2::ErrorUnexpectedParen:
      return "a ')' closes nothing" + found;
    case RE2::ErrorTrailingBackslash:
      return "it ends with a backslash";
    case RE2::ErrorRepeatArgument:
      return "'*', '+', '?' or '{}' repeats nothing" + found;
    case RE2::ErrorRepeatSize:
      return "a part is repeated more than 1000 times" + found;
    case RE2::ErrorRepeatOp:
      return "a repetition is repeated" + found;
    case RE2::ErrorBadCharRange:
      return "a range of characters is the wrong way round" + found;
    case RE2::ErrorPatternTooLarge:
      return "it is too large";
    default:
      return std::string("it is not understood") + found;
  }
}

std::string group_text(const Groups& groups, std::size_t index) {
  if (index >= groups.size()) return {};
  return std::string(groups[index].data() ? groups[index].data() : "", groups[index].size());
}

/// What `replacement` stands for after one match.
class Expansion {
 public:
  Expansion(const RE2& regex, std::string_view replacement)
      : regex_(regex), replacement_(replacement) {}

  void append(const Groups& groups, std::string& out) const {
    for (std::size_t i = 0; i < replacement_.size(); ++i) {
      const bool is_last = i + 1 == replacement_.size();
      if (replacement_[i] != '$' || is_last) {
        out += replacement_[i];
        continue;
      }
      i += append_reference(replacement_.substr(i + 1), groups, out);
    }
  }

 private:
  static bool is_digit(char c) { return c >= '0' && c <= '9'; }

  /// Returns how many characters behind the dollar sign belong to it.
  std::size_t append_reference(std::string_view text, const Groups& groups,
                               std::string& out) const {
    if (text[0] == '$' || text[0] == '&') {
      out += text[0] == '$' ? "$" : group_text(groups, 0);
      return 1;
    }
    if (is_digit(text[0])) {
      // Two digits are one group where there are that many.
      std::size_t digits = text.size() > 1 && is_digit(text[1]) ? 2 : 1;
      if (digits == 2 && number(text.substr(0, 2)) >= groups.size()) digits = 1;
      out += group_text(groups, number(text.substr(0, digits)));
      return digits;
    }
    const std::size_t end = text[0] == '{' ? text.find('}') : std::string_view::npos;
    if (end == std::string_view::npos) {
      out += '$';
      return 0;
    }
    const std::string name(text.substr(1, end - 1));
    const auto& names = regex_.NamedCapturingGroups();
    if (const auto found = names.find(name); found != names.end()) {
      out += group_text(groups, std::size_t(found->second));
    } else if (!name.empty() && is_digit(name.front())) {
      out += group_text(groups, number(name));
    }
    return end + 1;
  }

  static std::size_t number(std::string_view digits) {
    std::size_t value = 0;
    std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return value;
  }

  const RE2& regex_;
  std::string_view replacement_;
};

}  // namespace

struct LabelPattern::State {
  explicit State(const std::string& pattern) : regex(pattern, options()) {}
  RE2 regex;
};

LabelPattern::LabelPattern(const std::string& pattern) : state_(std::make_unique<State>(pattern)) {
  if (state_->regex.ok()) return;
  throw Error(ErrorKind::Config, "not a regular expression: " + fault_in(state_->regex));
}

LabelPattern::~LabelPattern() = default;
LabelPattern::LabelPattern(LabelPattern&&) noexcept = default;
LabelPattern& LabelPattern::operator=(LabelPattern&&) noexcept = default;

std::string LabelPattern::replaced(std::string_view text, std::string_view replacement) const {
  const RE2& regex = state_->regex;
  Groups groups(std::size_t(regex.NumberOfCapturingGroups()) + 1);
  const Expansion expansion(regex, replacement);
  const re2::StringPiece piece(text.data(), text.size());
  std::string out;
  std::size_t at = 0;
  while (at <= text.size() &&
         regex.Match(piece, at, text.size(), RE2::UNANCHORED, groups.data(), int(groups.size()))) {
    const auto begin = std::size_t(groups[0].data() - text.data());
    out += text.substr(at, begin - at);
    expansion.append(groups, out);
    at = begin + groups[0].size();
    if (!groups[0].empty()) continue;
    // After an empty match the search goes on behind the next character.
    const std::size_t length = std::max<std::size_t>(utf8_length(text.substr(at)), 1);
    out += text.substr(std::min(at, text.size()), length);
    at += length;
  }
  if (at < text.size()) out += text.substr(at);
  return out;
}

}  // namespace diorama
