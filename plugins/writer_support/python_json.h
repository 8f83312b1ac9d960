// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "diorama/math.h"

namespace diorama {

/// Keys keep the order in which they were put in.
using Json = nlohmann::ordered_json;

/// The text that Python's json.dumps gives: ", " and ": " as separators (a line per element with
/// `indent` >= 0), non-ASCII characters as \uXXXX, floats as Python prints them, NaN and Infinity
/// as such. No line break at the end. Throws Error(Internal) when a text is not UTF-8.
std::string python_json(const Json& value, int indent = -1);

/// As Python's repr(): the fewest digits that give the same double again, "1.0", "1e-05", "-0.0".
std::string python_float(double value);

/// As Python's round(value, decimals): to the nearest decimal, ties judged on the exact value.
double python_round(double value, int decimals);

/// Rows as nested lists. Numbers are doubles, so integral values print as "1.0".
template <class Derived>
Json nested_list(const Eigen::MatrixBase<Derived>& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    Json row = Json::array();
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) row.push_back(double(matrix(r, c)));
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Row by row in one list.
template <class Derived>
Json flat_list(const Eigen::MatrixBase<Derived>& matrix) {
  Json list = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) list.push_back(double(matrix(r, c)));
  }
  return list;
}

}  // namespace diorama
