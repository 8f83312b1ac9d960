// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/param_variants.h"

#include <algorithm>

namespace diorama {

std::vector<std::pair<std::string, std::string>> conditions_of(const ParamSpec& variant) {
  std::vector<std::pair<std::string, std::string>> conditions;
  for (const std::string& text : variant.choices) {
    const std::size_t cut = text.find('=');
    if (cut != text.npos) conditions.emplace_back(text.substr(0, cut), text.substr(cut + 1));
  }
  return conditions;
}

const ParamSpec* variant_of(const ParamSpec& spec, const Value& map) {
  if (spec.type != ParamType::Any) return nullptr;
  for (const ParamSpec& variant : spec.children) {
    const auto conditions = conditions_of(variant);
    const bool is_meant = std::ranges::all_of(conditions, [&](const auto& condition) {
      const Value* value = map.find(condition.first);
      return value && value->kind == Value::Kind::Scalar && value->scalar == condition.second;
    });
    if (is_meant) return &variant;
  }
  return nullptr;
}

}  // namespace diorama
