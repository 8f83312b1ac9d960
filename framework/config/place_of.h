// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "diorama/config.h"

namespace diorama {

/// Where a mapping has the value of a key; where the mapping begins when it lacks the key. Lives as
/// long as `map`.
inline const SourceLocation& place_of(const Value& map, std::string_view key) {
  const Value* value = map.find(key);
  return value ? value->place : map.place;
}

}  // namespace diorama
