// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/config.h"

namespace diorama {

/// "configs/dining.yaml:31:7: fill: ", or without the place for values that come from no file: the
/// beginning of a complaint about `value`.
inline std::string complaint_about(const Value& value, const std::string& key) {
  const std::string place = value.place.text();
  return place.empty() ? key + ": " : place + ": " + key + ": ";
}

/// A list of texts; null, which Replicator's defaults hold, is an empty one. Throws Error(Config).
inline std::vector<std::string> texts_or_null(const Value& value, const std::string& key) {
  std::vector<std::string> texts;
  for (const Value& text : value.list) texts.push_back(text.scalar);
  bool is_good = value.kind == Value::Kind::List || value.kind == Value::Kind::Null;
  for (const Value& text : value.list) is_good = is_good && text.kind == Value::Kind::Scalar;
  if (is_good) return texts;
  throw Error(ErrorKind::Config, complaint_about(value, key) +
                                     "expected a list of texts or null, found " + value.describe());
}

}  // namespace diorama
