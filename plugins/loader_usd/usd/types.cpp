// SPDX-License-Identifier: Apache-2.0
#include "types.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

namespace diorama::usd {
namespace {

struct TypeEntry {
  std::string_view name;
  std::string_view canonical;
  Type type;
};

// The value type names of the format and, after them, those of its first versions.
constexpr std::array kTypeNames = {
    TypeEntry{"bool", "bool", Type::Bool},
    TypeEntry{"uchar", "uchar", Type::UChar},
    TypeEntry{"int", "int", Type::Int},
    TypeEntry{"uint", "uint", Type::UInt},
    TypeEntry{"int64", "int64", Type::Int64},
    TypeEntry{"uint64", "uint64", Type::UInt64},
    TypeEntry{"half", "half", Type::Half},
    TypeEntry{"float", "float", Type::Float},
    TypeEntry{"double", "double", Type::Double},
    TypeEntry{"timecode", "timecode", Type::TimeCode},
    TypeEntry{"string", "string", Type::String},
    TypeEntry{"token", "token", Type::Token},
    TypeEntry{"asset", "asset", Type::AssetPath},
    TypeEntry{"pathExpression", "pathExpression", Type::PathExpression},
    TypeEntry{"int2", "int2", Type::Vec2i},
    TypeEntry{"int3", "int3", Type::Vec3i},
    TypeEntry{"int4", "int4", Type::Vec4i},
    TypeEntry{"half2", "half2", Type::Vec2h},
    TypeEntry{"half3", "half3", Type::Vec3h},
    TypeEntry{"half4", "half4", Type::Vec4h},
    TypeEntry{"float2", "float2", Type::Vec2f},
    TypeEntry{"float3", "float3", Type::Vec3f},
    TypeEntry{"float4", "float4", Type::Vec4f},
    TypeEntry{"double2", "double2", Type::Vec2d},
    TypeEntry{"double3", "double3", Type::Vec3d},
    TypeEntry{"double4", "double4", Type::Vec4d},
    TypeEntry{"point3h", "point3h", Type::Vec3h},
    TypeEntry{"point3f", "point3f", Type::Vec3f},
    TypeEntry{"point3d", "point3d", Type::Vec3d},
    TypeEntry{"vector3h", "vector3h", Type::Vec3h},
    TypeEntry{"vector3f", "vector3f", Type::Vec3f},
    TypeEntry{"vector3d", "vector3d", Type::Vec3d},
    TypeEntry{"normal3h", "normal3h", Type::Vec3h},
    TypeEntry{"normal3f", "normal3f", Type::Vec3f},
    TypeEntry{"normal3d", "normal3d", Type::Vec3d},
    TypeEntry{"color3h", "color3h", Type::Vec3h},
    TypeEntry{"color3f", "color3f", Type::Vec3f},
    TypeEntry{"color3d", "color3d", Type::Vec3d},
    TypeEntry{"color4h", "color4h", Type::Vec4h},
    TypeEntry{"color4f", "color4f", Type::Vec4f},
    TypeEntry{"color4d", "color4d", Type::Vec4d},
    TypeEntry{"texCoord2h", "texCoord2h", Type::Vec2h},
    TypeEntry{"texCoord2f", "texCoord2f", Type::Vec2f},
    TypeEntry{"texCoord2d", "texCoord2d", Type::Vec2d},
    TypeEntry{"texCoord3h", "texCoord3h", Type::Vec3h},
    TypeEntry{"texCoord3f", "texCoord3f", Type::Vec3f},
    TypeEntry{"texCoord3d", "texCoord3d", Type::Vec3d},
    TypeEntry{"quath", "quath", Type::Quath},
    TypeEntry{"quatf", "quatf", Type::Quatf},
    TypeEntry{"quatd", "quatd", Type::Quatd},
    TypeEntry{"matrix2d", "matrix2d", Type::Matrix2d},
    TypeEntry{"matrix3d", "matrix3d", Type::Matrix3d},
    TypeEntry{"matrix4d", "matrix4d", Type::Matrix4d},
    TypeEntry{"frame4d", "frame4d", Type::Matrix4d},
    TypeEntry{"Vec2i", "int2", Type::Vec2i},
    TypeEntry{"Vec2h", "half2", Type::Vec2h},
    TypeEntry{"Vec2f", "float2", Type::Vec2f},
    TypeEntry{"Vec2d", "double2", Type::Vec2d},
    TypeEntry{"Vec3i", "int3", Type::Vec3i},
    TypeEntry{"Vec3h", "half3", Type::Vec3h},
    TypeEntry{"Vec3f", "float3", Type::Vec3f},
    TypeEntry{"Vec3d", "double3", Type::Vec3d},
    TypeEntry{"Vec4i", "int4", Type::Vec4i},
    TypeEntry{"Vec4h", "half4", Type::Vec4h},
    TypeEntry{"Vec4f", "float4", Type::Vec4f},
    TypeEntry{"Vec4d", "double4", Type::Vec4d},
    TypeEntry{"Point", "point3d", Type::Vec3d},
    TypeEntry{"PointFloat", "point3f", Type::Vec3f},
    TypeEntry{"Normal", "normal3d", Type::Vec3d},
    TypeEntry{"NormalFloat", "normal3f", Type::Vec3f},
    TypeEntry{"Vector", "vector3d", Type::Vec3d},
    TypeEntry{"VectorFloat", "vector3f", Type::Vec3f},
    TypeEntry{"Color", "color3d", Type::Vec3d},
    TypeEntry{"ColorFloat", "color3f", Type::Vec3f},
    TypeEntry{"Quath", "quath", Type::Quath},
    TypeEntry{"Quatf", "quatf", Type::Quatf},
    TypeEntry{"Quatd", "quatd", Type::Quatd},
    TypeEntry{"Matrix2d", "matrix2d", Type::Matrix2d},
    TypeEntry{"Matrix3d", "matrix3d", Type::Matrix3d},
    TypeEntry{"Matrix4d", "matrix4d", Type::Matrix4d},
    TypeEntry{"Frame", "frame4d", Type::Matrix4d},
    TypeEntry{"Transform", "matrix4d", Type::Matrix4d},
    TypeEntry{"PointIndex", "int", Type::Int},
    TypeEntry{"EdgeIndex", "int", Type::Int},
    TypeEntry{"FaceIndex", "int", Type::Int},
    TypeEntry{"Schema", "token", Type::Token},
};

}  // namespace

NumericLayout numeric_layout(Type type) {
  switch (type) {
    case Type::Bool:
      return {Type::Bool, 1, 1};
    case Type::UChar:
      return {Type::UChar, 1, 1};
    case Type::Int:
      return {Type::Int, 4, 1};
    case Type::UInt:
      return {Type::UInt, 4, 1};
    case Type::Int64:
      return {Type::Int64, 8, 1};
    case Type::UInt64:
      return {Type::UInt64, 8, 1};
    case Type::Half:
      return {Type::Half, 2, 1};
    case Type::Float:
      return {Type::Float, 4, 1};
    case Type::Double:
    case Type::TimeCode:
      return {Type::Double, 8, 1};
    case Type::Matrix2d:
      return {Type::Double, 8, 4};
    case Type::Matrix3d:
      return {Type::Double, 8, 9};
    case Type::Matrix4d:
      return {Type::Double, 8, 16};
    case Type::Quatd:
    case Type::Vec4d:
      return {Type::Double, 8, 4};
    case Type::Quatf:
    case Type::Vec4f:
      return {Type::Float, 4, 4};
    case Type::Quath:
    case Type::Vec4h:
      return {Type::Half, 2, 4};
    case Type::Vec2d:
      return {Type::Double, 8, 2};
    case Type::Vec2f:
      return {Type::Float, 4, 2};
    case Type::Vec2h:
      return {Type::Half, 2, 2};
    case Type::Vec2i:
      return {Type::Int, 4, 2};
    case Type::Vec3d:
      return {Type::Double, 8, 3};
    case Type::Vec3f:
      return {Type::Float, 4, 3};
    case Type::Vec3h:
      return {Type::Half, 2, 3};
    case Type::Vec3i:
      return {Type::Int, 4, 3};
    case Type::Vec4i:
      return {Type::Int, 4, 4};
    default:
      return {};
  }
}

bool is_text(Type type) {
  return type == Type::String || type == Type::Token || type == Type::AssetPath ||
         type == Type::PathExpression;
}

float half_to_float(std::uint16_t half) {
  const std::uint32_t sign = std::uint32_t{half & 0x8000u} << 16;
  const std::uint32_t exponent = (half >> 10) & 0x1Fu;
  const std::uint32_t mantissa = half & 0x3FFu;
  if (exponent == 0) {  // Zero and denormals: exact in float.
    const float value = std::ldexp(static_cast<float>(mantissa), -24);
    return sign ? -value : value;
  }
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7F800000u | (mantissa << 13));
  return std::bit_cast<float>(sign | ((exponent + 112) << 23) | (mantissa << 13));
}

std::uint16_t float_to_half(float value) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
  const auto sign = static_cast<std::uint16_t>((bits >> 16) & 0x8000u);
  const float magnitude = std::fabs(value);
  if (std::isnan(value)) return sign | 0x7E00u;
  if (magnitude >= 65520.0f) return sign | 0x7C00u;
  if (magnitude < 6.103515625e-05f) {
    // nearbyint rounds half to even, as the format's own conversion does.
    return sign | static_cast<std::uint16_t>(std::nearbyint(std::ldexp(magnitude, 24)));
  }
  int exponent = 0;
  const float fraction = std::frexp(magnitude, &exponent);  // In [0.5, 1).
  const auto mantissa = static_cast<std::uint32_t>(std::nearbyint(std::ldexp(fraction, 11)));
  // The leading bit of the mantissa counts once in the exponent, and so does a carry to 2048.
  return static_cast<std::uint16_t>(sign + ((exponent + 13) << 10) + mantissa);
}

ValueTypeName parse_value_type(std::string_view name) {
  ValueTypeName result;
  std::string_view base = name;
  if (base.ends_with("[]")) {
    result.is_array = true;
    base.remove_suffix(2);
  }
  const auto* entry = std::find_if(kTypeNames.begin(), kTypeNames.end(),
                                   [&](const TypeEntry& e) { return e.name == base; });
  if (entry == kTypeNames.end()) {
    result.canonical = name;
    return result;
  }
  result.type = entry->type;
  result.canonical = std::string(entry->canonical) + (result.is_array ? "[]" : "");
  return result;
}

}  // namespace diorama::usd
