// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// Which labels count, as Replicator's semantic filter predicate says it: clauses `type:
/// expression`, separated by ';' (or by a ',' when another "type:" follows). In an expression '|'
/// and ',' mean or, '&' and, '!' not, parentheses group, '*' is every label; the type '*' is every
/// type: "class: car & !broken; shape: *".
class SemanticFilter {
 public:
  /// Throws Error(Config) that quotes the predicate and says what was expected where.
  static SemanticFilter parse(std::string_view predicate);
  /// The filter that semantic_types or semantic_filter_predicate of a Replicator writer mean;
  /// "class: *" when both are empty. Throws Error(Config) when both are given.
  static SemanticFilter from_params(std::span<const std::string> types,
                                    const std::optional<std::string>& predicate);

  /// The labels that count; empty when none does. Labels of one type are separated by commas.
  Labels apply(const Labels& labels) const;

  struct Expression;

 private:
  struct Clause {
    std::string type;
    std::shared_ptr<const Expression> expression;
  };
  friend class SemanticFilterParser;
  std::vector<Clause> clauses_;
};

}  // namespace diorama
