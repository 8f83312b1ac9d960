// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/config.h"

namespace diorama {

/// "configs/dining.yaml:31:7: fill: ", or without the place for values that come from no file: the
/// beginning of a complaint about `value`.
inline std::string complaint_about(const Value& value, const std::string& key) {
  const std::string place = value.place.text();
  return place.empty() ? key + ": " : place + ": " + key + ": ";
}

}  // namespace diorama
