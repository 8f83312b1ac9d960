// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace diorama::usd {

/// Value types, numbered as in crate files (../README.md names the description).
enum class Type : std::uint8_t {
  Invalid = 0,
  Bool = 1,
  UChar = 2,
  Int = 3,
  UInt = 4,
  Int64 = 5,
  UInt64 = 6,
  Half = 7,
  Float = 8,
  Double = 9,
  String = 10,
  Token = 11,
  AssetPath = 12,
  Matrix2d = 13,
  Matrix3d = 14,
  Matrix4d = 15,
  Quatd = 16,
  Quatf = 17,
  Quath = 18,
  Vec2d = 19,
  Vec2f = 20,
  Vec2h = 21,
  Vec2i = 22,
  Vec3d = 23,
  Vec3f = 24,
  Vec3h = 25,
  Vec3i = 26,
  Vec4d = 27,
  Vec4f = 28,
  Vec4h = 29,
  Vec4i = 30,
  Dictionary = 31,
  TokenListOp = 32,
  StringListOp = 33,
  PathListOp = 34,
  ReferenceListOp = 35,
  IntListOp = 36,
  Int64ListOp = 37,
  UIntListOp = 38,
  UInt64ListOp = 39,
  PathVector = 40,
  TokenVector = 41,
  Specifier = 42,
  Permission = 43,
  Variability = 44,
  VariantSelectionMap = 45,
  TimeSamples = 46,
  Payload = 47,
  DoubleVector = 48,
  LayerOffsetVector = 49,
  StringVector = 50,
  ValueBlock = 51,
  Value = 52,
  UnregisteredValue = 53,
  UnregisteredValueListOp = 54,
  PayloadListOp = 55,
  TimeCode = 56,
  PathExpression = 57,
  Relocates = 58,
  Spline = 59,
  AnimationBlock = 60,
};

/// Kinds of specs, numbered as in crate files.
enum class SpecType : std::uint8_t {
  Unknown = 0,
  Attribute = 1,
  Connection = 2,
  Expression = 3,
  Mapper = 4,
  MapperArgument = 5,
  Prim = 6,
  PseudoRoot = 7,
  Relationship = 8,
  RelationshipTarget = 9,
  Variant = 10,
  VariantSet = 11,
};

enum class Specifier : std::uint8_t { Def = 0, Over = 1, Class = 2 };

/// The layout of a plain numeric type: `count` components of `component`, each `component_size`
/// bytes. Types without such a layout have count 0.
struct NumericLayout {
  Type component = Type::Invalid;
  std::uint8_t component_size = 0;
  std::uint8_t count = 0;
  std::size_t size() const { return std::size_t{component_size} * count; }
};

NumericLayout numeric_layout(Type type);

/// String, token, asset path, path expression.
bool is_text(Type type);

/// Converts an IEEE half.
float half_to_float(std::uint16_t half);
std::uint16_t float_to_half(float value);

/// An attribute's value type as a layer names it: `color3f[]`.
struct ValueTypeName {
  Type type = Type::Invalid;  ///< Invalid: a name that USD does not know.
  bool is_array = false;
  std::string canonical;  ///< Current name for an old one: `Vec3f[]` becomes `float3[]`.
};

ValueTypeName parse_value_type(std::string_view name);

}  // namespace diorama::usd
