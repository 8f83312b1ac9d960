// SPDX-License-Identifier: Apache-2.0
#include "variable_expression.h"

#include <charconv>
#include <variant>
#include <vector>

#include "path.h"

namespace diorama::usd {
namespace {

constexpr int kMaxExpressionNesting = 32;

struct Term;
using Terms = std::vector<Term>;

// What an expression evaluates to; monostate is None.
struct Term {
  std::variant<std::monostate, bool, std::int64_t, std::string, Terms> value;
  friend bool operator==(const Term&, const Term&) = default;
};

class Failure {};

class Evaluator {
 public:
  Evaluator(std::string_view text, const Dictionary& variables, int nesting)
      : text_(text), variables_(variables), nesting_(nesting) {
    if (nesting > kMaxExpressionNesting) throw Failure{};
  }

  Term evaluate() {
    Term result = term();
    skip_spaces();
    if (at_ != text_.size()) throw Failure{};
    return result;
  }

 private:
  void skip_spaces() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) ++at_;
  }
  char peek() const { return at_ < text_.size() ? text_[at_] : '\0'; }
  bool accept(char c) {
    skip_spaces();
    if (peek() != c) return false;
    ++at_;
    return true;
  }
  Term term();
  Term quoted(char quote);
  Term variable(std::string_view name) const;
  Terms list(char close);
  Term call(std::string_view name);

  std::string_view text_;
  const Dictionary& variables_;
  int nesting_;
  std::size_t at_ = 0;
};

Term from_value(const Value& value, const Dictionary& variables, int nesting) {
  if (const std::string* text = value.as_text()) {
    if (!is_expression(*text)) return {*text};
    return Evaluator(std::string_view(*text).substr(1, text->size() - 2), variables, nesting + 1)
        .evaluate();
  }
  if (const Strings* items = value.as_strings()) {
    Terms terms;
    for (const std::string& item : *items) terms.push_back({item});
    return {terms};
  }
  if (value.type() == Type::Bool) return {*value.as_bool()};
  const auto number = value.as_number();
  if (!number) throw Failure{};
  return {static_cast<std::int64_t>(*number)};
}

Term Evaluator::variable(std::string_view name) const {
  const auto found = variables_.find(name);
  if (found == variables_.end()) throw Failure{};
  return from_value(found->second, variables_, nesting_);
}

Term Evaluator::quoted(char quote) {
  std::string result;
  while (peek() != quote) {
    if (at_ >= text_.size()) throw Failure{};
    if (text_.substr(at_).starts_with("${")) {
      const std::size_t close = text_.find('}', at_);
      if (close == std::string_view::npos) throw Failure{};
      const Term value = variable(text_.substr(at_ + 2, close - at_ - 2));
      const auto* text = std::get_if<std::string>(&value.value);
      if (!text) throw Failure{};
      result += *text;
      at_ = close + 1;
      continue;
    }
    if (peek() == '\\' && at_ + 1 < text_.size()) ++at_;
    result += text_[at_++];
  }
  ++at_;
  return {result};
}

Terms Evaluator::list(char close) {
  Terms terms;
  while (!accept(close)) {
    if (!terms.empty() && !accept(',')) throw Failure{};
    terms.push_back(term());
  }
  return terms;
}

Term Evaluator::term() {
  skip_spaces();
  if (++nesting_ > kMaxExpressionNesting) throw Failure{};
  for (const char quote : {'"', '\''}) {
    if (accept(quote)) return --nesting_, quoted(quote);
  }
  if (accept('[')) return --nesting_, Term{list(']')};
  if (text_.substr(at_).starts_with("${")) {
    const std::size_t close = text_.find('}', at_);
    if (close == std::string_view::npos) throw Failure{};
    const std::string_view name = text_.substr(at_ + 2, close - at_ - 2);
    at_ = close + 1;
    --nesting_;
    return variable(name);
  }
  std::int64_t number = 0;
  const auto [end, error] =
      std::from_chars(text_.data() + at_, text_.data() + text_.size(), number);
  if (error == std::errc{}) {
    at_ = static_cast<std::size_t>(end - text_.data());
    --nesting_;
    return {number};
  }
  const std::string_view word = text_.substr(at_, path::identifier_length(text_.substr(at_)));
  if (word.empty()) throw Failure{};
  at_ += word.size();
  Term result;
  if (accept('(')) {
    result = call(word);
  } else if (word == "True" || word == "true") {
    result.value = true;
  } else if (word == "False" || word == "false") {
    result.value = false;
  } else if (word != "None" && word != "none") {
    throw Failure{};
  }
  --nesting_;
  return result;
}

bool truth(const Term& term) {
  const auto* value = std::get_if<bool>(&term.value);
  if (!value) throw Failure{};
  return *value;
}

int order(const Term& a, const Term& b) {
  if (a.value.index() != b.value.index()) throw Failure{};
  if (const auto* x = std::get_if<std::int64_t>(&a.value)) {
    const auto y = std::get<std::int64_t>(b.value);
    return *x < y ? -1 : *x > y;
  }
  if (const auto* x = std::get_if<std::string>(&a.value)) {
    return x->compare(std::get<std::string>(b.value));
  }
  throw Failure{};
}

Term at(const Term& whole, const Term& index) {
  const auto* number = std::get_if<std::int64_t>(&index.value);
  if (!number) throw Failure{};
  const auto pick = [&](std::size_t size) {
    const std::int64_t i = *number < 0 ? *number + static_cast<std::int64_t>(size) : *number;
    if (i < 0 || i >= static_cast<std::int64_t>(size)) throw Failure{};
    return static_cast<std::size_t>(i);
  };
  if (const auto* text = std::get_if<std::string>(&whole.value)) {
    return {std::string(1, (*text)[pick(text->size())])};
  }
  const auto* items = std::get_if<Terms>(&whole.value);
  if (!items) throw Failure{};
  return (*items)[pick(items->size())];
}

Term contains(const Term& whole, const Term& part) {
  if (const auto* items = std::get_if<Terms>(&whole.value)) {
    for (const Term& item : *items) {
      if (item == part) return {true};
    }
    return {false};
  }
  const auto* text = std::get_if<std::string>(&whole.value);
  const auto* piece = std::get_if<std::string>(&part.value);
  if (!text || !piece) throw Failure{};
  return {text->find(*piece) != std::string::npos};
}

Term Evaluator::call(std::string_view name) {
  const Terms terms = list(')');
  const std::size_t count = terms.size();
  if (name == "if" && (count == 2 || count == 3)) {
    if (truth(terms[0])) return terms[1];
    return count == 3 ? terms[2] : Term{};
  }
  if (name == "not" && count == 1) return {!truth(terms[0])};
  if ((name == "and" || name == "or") && count >= 2) {
    bool result = name == "and";
    for (const Term& term : terms) {
      result = name == "and" ? (truth(term) && result) : (truth(term) || result);
    }
    return {result};
  }
  if (name == "defined" && count >= 1) {
    for (const Term& term : terms) {
      const auto* text = std::get_if<std::string>(&term.value);
      if (!text || !variables_.contains(*text)) return {false};
    }
    return {true};
  }
  if (name == "len" && count == 1) {
    if (const auto* text = std::get_if<std::string>(&terms[0].value)) {
      return {static_cast<std::int64_t>(text->size())};
    }
    if (const auto* items = std::get_if<Terms>(&terms[0].value)) {
      return {static_cast<std::int64_t>(items->size())};
    }
    throw Failure{};
  }
  if (count != 2) throw Failure{};
  if (name == "eq") return {terms[0] == terms[1]};
  if (name == "neq") return {!(terms[0] == terms[1])};
  if (name == "lt") return {order(terms[0], terms[1]) < 0};
  if (name == "leq") return {order(terms[0], terms[1]) <= 0};
  if (name == "gt") return {order(terms[0], terms[1]) > 0};
  if (name == "geq") return {order(terms[0], terms[1]) >= 0};
  if (name == "at") return at(terms[0], terms[1]);
  if (name == "contains") return contains(terms[0], terms[1]);
  throw Failure{};
}

}  // namespace

bool is_expression(std::string_view text) {
  return text.size() >= 2 && text.front() == '`' && text.back() == '`';
}

std::optional<std::string> evaluate_expression(std::string_view text, const Dictionary& variables) {
  try {
    const Term result = Evaluator(text.substr(1, text.size() - 2), variables, 0).evaluate();
    if (std::holds_alternative<std::monostate>(result.value)) return std::string();
    if (const auto* value = std::get_if<std::string>(&result.value)) return *value;
  } catch (const Failure&) {
    // Reported by the caller, who knows the layer.
  }
  return std::nullopt;
}

}  // namespace diorama::usd
