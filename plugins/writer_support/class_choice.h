// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/params.h"
#include "diorama/scene.h"
#include "writer_support/semantic_filter.h"

namespace diorama {

/// Which of an object's labels is its class: that of the first taxonomy it has a label in.
class ClassChoice {
 public:
  explicit ClassChoice(std::string taxonomy) : taxonomies_{std::move(taxonomy)} {}
  /// Only labels that pass the filter count; those of other taxonomies than the named ones come
  /// last.
  ClassChoice(std::vector<std::string> taxonomies, SemanticFilter filter)
      : taxonomies_(std::move(taxonomies)), filter_(std::move(filter)) {}

  /// Nothing for an object without such a label.
  std::optional<std::string> of(const Labels& labels) const;

 private:
  std::vector<std::string> taxonomies_;
  std::optional<SemanticFilter> filter_;
};

/// Parameters by which Replicator's writers choose labels.
struct ReplicatorLabels {
  Value semantic_types;  ///< A list of texts or null.
  std::optional<std::string> semantic_filter_predicate;

  void visit(ParamVisitor& v);
  /// `taxonomy` counts where neither is given. Throws Error(Config).
  ClassChoice choice(const std::string& taxonomy) const;
};

}  // namespace diorama
