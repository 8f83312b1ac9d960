// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

/// JSON files of others.
namespace diorama {

/// Throws std::runtime_error when brackets nest deeper than 100: copying, printing and destroying a
/// tree walks down by recursion.
void check_json_depth(std::string_view text);

/// Throws std::exception for texts that are no JSON or nest too deep.
template <class Json = nlohmann::json>
Json parse_json(std::string_view text) {
  check_json_depth(text);
  return Json::parse(text);
}

/// The same, but a discarded value instead of an exception.
template <class Json = nlohmann::json>
Json parse_json_or_nothing(std::string_view text) {
  try {
    return parse_json<Json>(text);
  } catch (const std::exception&) {
    return Json(Json::value_t::discarded);
  }
}

}  // namespace diorama
