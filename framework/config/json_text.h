// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>

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

/// Cuts off what is behind the point, as get() does. Throws std::exception for what is no number,
/// and for numbers that the type cannot hold: with those get() does what it likes.
template <class Whole, class Json>
Whole whole_of_json(const Json& value) {
  bool fits = true;
  if (value.is_number_float()) {
    const auto number = value.template get<double>();
    fits = number > double(std::numeric_limits<Whole>::min()) - 1.0 &&
           number < double(std::numeric_limits<Whole>::max()) + 1.0;
  } else if (value.is_number_unsigned()) {
    fits = std::in_range<Whole>(value.template get<std::uint64_t>());
  } else if (value.is_number_integer()) {
    fits = std::in_range<Whole>(value.template get<std::int64_t>());
  }
  if (!fits) throw std::runtime_error(value.dump() + " is beyond reason");
  return value.template get<Whole>();
}

}  // namespace diorama
