// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "diorama/math.h"

/// A USD layer in memory, as far as the exporter needs one.
namespace diorama::usd_export {

struct Token {
  std::string text;
  friend bool operator==(const Token&, const Token&) = default;
};
/// A path of another file, as written.
struct AssetPath {
  std::string text;
  friend bool operator==(const AssetPath&, const AssetPath&) = default;
};
/// Row by row, for row vectors: the translation is the last row.
using Matrix = std::array<double, 16>;
using Double3 = std::array<double, 3>;
using Float4 = std::array<float, 4>;

using Value = std::variant<bool, int, float, double, std::string, Token, AssetPath, Vec2f, Vec3f,
                           Float4, Eigen::Quaternionf, Double3, Matrix, std::vector<Token>,
                           std::vector<int>, std::vector<Vec2f>, std::vector<Vec3f>>;

/// An attribute, or a relationship when `type` is empty.
struct Property {
  std::string name;
  std::string type;  ///< "point3f[]", "token" ...
  std::optional<Value> value;
  bool is_uniform = false;
  bool is_custom = false;
  std::string interpolation;  ///< Of primvars; empty: not said.
  std::vector<std::string>
      targets;  ///< Paths: of a relationship, or what an attribute connects to.
};

struct Prim {
  std::string name;
  std::string type;  ///< "Xform", "Mesh" ...
  std::vector<std::string> api_schemas;
  std::string kind;  ///< "component" ...; empty: none.
  std::vector<Property> properties;
  std::vector<Prim> children;

  /// Adds a plain attribute.
  void set(std::string property, std::string property_type, Value value);
  /// Adds a uniform one.
  void set_uniform(std::string property, std::string property_type, Value value);
  void connect(std::string property, std::string property_type, std::string target);
  void relate(std::string property, std::string target);
};

/// Z up, metres. The first root prim is the default one.
struct Layer {
  std::vector<Prim> roots;
};

}  // namespace diorama::usd_export
