// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
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

/// Throws std::exception for what is no number, and for numbers that an int cannot hold: with those
/// get() does what it likes.
template <class Json>
int int_of_json(const Json& value) {
  const double number = value.template get<double>();
  constexpr double kMost = std::numeric_limits<int>::max();
  if (!(number >= -kMost && number <= kMost)) {
    throw std::runtime_error(value.dump() + " is beyond reason");
  }
  return value.template get<int>();
}

}  // namespace diorama
