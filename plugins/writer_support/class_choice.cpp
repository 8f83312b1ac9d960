// SPDX-License-Identifier: Apache-2.0
#include "writer_support/class_choice.h"

#include "writer_support/value_place.h"

namespace diorama {

std::optional<std::string> ClassChoice::of(const Labels& labels) const {
  const Labels counting = filter_ ? filter_->apply(labels) : labels;
  for (const std::string& taxonomy : taxonomies_) {
    const auto label = counting.find(taxonomy);
    if (label != counting.end()) return label->second;
  }
  if (filter_ && !counting.empty()) return counting.begin()->second;
  return std::nullopt;
}

void ReplicatorLabels::visit(ParamVisitor& v) {
  v.param(
      "semantic_types", semantic_types,
      {"List of taxonomies whose labels may be an object's class, the first that it has counts; "
       "null: taxonomy alone. Excludes semantic_filter_predicate."});
  v.param("semantic_filter_predicate", semantic_filter_predicate,
          {"Which labels may be an object's class, such as 'class: car & !broken'."});
}

ClassChoice ReplicatorLabels::choice(const std::string& taxonomy) const {
  std::vector<std::string> types = texts_or_null(semantic_types, "semantic_types");
  if (types.empty() && !semantic_filter_predicate) return ClassChoice(taxonomy);
  SemanticFilter filter = SemanticFilter::from_params(types, semantic_filter_predicate);
  if (types.empty()) types.push_back(taxonomy);
  return {std::move(types), std::move(filter)};
}

}  // namespace diorama
