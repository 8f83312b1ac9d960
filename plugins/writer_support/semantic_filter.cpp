// SPDX-License-Identifier: Apache-2.0
#include "writer_support/semantic_filter.h"

#include <algorithm>

#include "diorama/error.h"

namespace diorama {

/// Node of a parsed expression. Or and And have two operands or more, Not one, Label none.
struct SemanticFilter::Expression {
  enum class Kind { Label, Not, And, Or };
  Kind kind = Kind::Label;
  std::string label;
  std::vector<Expression> operands;

  bool accepts(const std::vector<std::string>& labels) const {
    const auto test = [&](const Expression& operand) { return operand.accepts(labels); };
    switch (kind) {
      case Kind::Label:
        return label == "*" || std::ranges::find(labels, label) != labels.end();
      case Kind::Not:
        return !operands[0].accepts(labels);
      case Kind::And:
        return std::ranges::all_of(operands, test);
      case Kind::Or:
        return std::ranges::any_of(operands, test);
    }
    return false;
  }
};

/// Recursive descent over the predicate's text.
class SemanticFilterParser {
 public:
  using Expression = SemanticFilter::Expression;

  explicit SemanticFilterParser(std::string_view text) : text_(text) {}

  SemanticFilter parse() {
    SemanticFilter filter;
    skip_space();
    while (at_ < text_.size()) {
      std::string type = word("a semantic type");
      expect(':');
      auto expression = std::make_shared<Expression>(any_of());
      filter.clauses_.push_back({std::move(type), std::move(expression)});
      skip_space();
      if (at_ < text_.size() && !take(';') && !take(',')) fail("';'");
      skip_space();
    }
    if (filter.clauses_.empty()) fail("a clause such as 'class: *'");
    return filter;
  }

 private:
  Expression any_of() {
    Expression result = all_of();
    while (!next_clause_begins() && (take('|') || take(','))) {
      result = joined(Expression::Kind::Or, std::move(result), all_of());
    }
    return result;
  }

  Expression all_of() {
    Expression result = single();
    while (take('&')) result = joined(Expression::Kind::And, std::move(result), single());
    return result;
  }

  Expression single() {
    if (take('!')) return {Expression::Kind::Not, "", {single()}};
    if (take('(')) {
      Expression inner = any_of();
      expect(')');
      return inner;
    }
    return {Expression::Kind::Label, word("a label"), {}};
  }

  static Expression joined(Expression::Kind kind, Expression a, Expression b) {
    if (a.kind != kind) a = {kind, "", {std::move(a)}};
    a.operands.push_back(std::move(b));
    return a;
  }

  /// True at a ',' after which a "type:" stands.
  bool next_clause_begins() {
    skip_space();
    if (at_ >= text_.size() || text_[at_] != ',') return false;
    const std::size_t end = text_.find_first_of(":;,|&!()", at_ + 1);
    return end != std::string_view::npos && text_[end] == ':';
  }

  std::string word(const char* meaning) {
    skip_space();
    const std::size_t end = std::min(text_.find_first_of(":;,|&!()", at_), text_.size());
    std::string_view found = text_.substr(at_, end - at_);
    while (!found.empty() && is_space(found.back())) found.remove_suffix(1);
    if (found.empty()) fail(meaning);
    at_ = end;
    return std::string(found);
  }

  bool take(char c) {
    skip_space();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }

  void expect(char c) {
    if (!take(c)) fail("'" + std::string(1, c) + "'");
  }

  [[noreturn]] void fail(const std::string& expected) const {
    const std::string found =
        at_ < text_.size() ? "'" + std::string(text_.substr(at_)) + "'" : std::string("the end");
    throw Error(ErrorKind::Config, "semantic filter '" + std::string(text_) + "': expected " +
                                       expected + ", found " + found);
  }

  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n'; }
  void skip_space() {
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

SemanticFilter SemanticFilter::parse(std::string_view predicate) {
  return SemanticFilterParser(predicate).parse();
}

SemanticFilter SemanticFilter::from_params(std::span<const std::string> types,
                                           const std::optional<std::string>& predicate) {
  if (predicate && !types.empty()) {
    throw Error(
        ErrorKind::Config,
        "semantic_types and semantic_filter_predicate exclude each other; give one of them");
  }
  if (predicate) return parse(*predicate);
  if (types.empty()) return parse("class:*");
  std::string text;
  for (const std::string& type : types) text += type + ":*;";
  return parse(text);
}

Labels SemanticFilter::apply(const Labels& labels) const {
  Labels kept;
  for (const auto& label : labels) {
    const std::string& type = label.first;
    const std::string& joined = label.second;
    std::vector<std::string> single;
    for (std::size_t begin = 0; begin <= joined.size();) {
      const std::size_t end = std::min(joined.find(',', begin), joined.size());
      single.push_back(joined.substr(begin, end - begin));
      begin = end + 1;
    }
    const bool counts = std::ranges::any_of(clauses_, [&](const Clause& clause) {
      return (clause.type == "*" || clause.type == type) && clause.expression->accepts(single);
    });
    if (counts) kept.emplace(type, joined);
  }
  return kept;
}

}  // namespace diorama
