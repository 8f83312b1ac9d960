// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/shader_network.h"

#include <cmath>

#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/path.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;

constexpr int kMaxConnections = 64;
constexpr std::string_view kInputs = "inputs:";
constexpr std::string_view kOutputs = "outputs:";

std::optional<Vec3f> to_color(const usd::Value& value) {
  std::array<double, 3> three{};
  std::array<double, 4> four{};
  if (value.read(three)) return Vec3f(three[0], three[1], three[2]);
  if (value.read(four)) return Vec3f(four[0], four[1], four[2]);
  if (value.is_array()) return std::nullopt;
  if (const auto number = value.as_number()) return Vec3f::Constant(static_cast<float>(*number));
  return std::nullopt;
}

}  // namespace

ShaderNetwork::Source ShaderNetwork::follow(const Prim& prim, const std::string& attribute) const {
  const Prim* at = &prim;
  std::string name = attribute;
  for (int i = 0; i < kMaxConnections; ++i) {
    const usd::Strings connections = stage_.connections(*at, name);
    if (connections.empty()) return {at, name, {}};
    const std::string& target = connections.front();
    const Prim* next = stage_.find(usd::path::prim_part(target));
    const std::string_view property = usd::path::property_part(target);
    if (!next || property.empty()) return {};
    if (next->type_name == "Shader" && property.starts_with(kOutputs)) {
      return {next, {}, std::string(property.substr(kOutputs.size()))};
    }
    at = next;
    name = property;
  }
  return {};
}

ShaderNetwork::Source ShaderNetwork::source(const Prim& shader, const std::string& input) const {
  return follow(shader, std::string(kInputs) + input);
}

const Prim* ShaderNetwork::surface(const Prim& material, std::string_view output) const {
  const Source source = follow(material, std::string(output));
  return source.is_shader() ? source.prim : nullptr;
}

std::string ShaderNetwork::id(const Prim& shader) const {
  return usd::token_or(stage_, shader, "info:id", "");
}

usd::FoundValue ShaderNetwork::input(const Prim& shader, const std::string& name) const {
  return value(source(shader, name));
}

usd::FoundValue ShaderNetwork::value(const Source& source) const {
  if (!source.prim || source.is_shader()) return {};
  return stage_.find_value(*source.prim, source.attribute);
}

std::string ShaderNetwork::text(const Prim& shader, const std::string& name,
                                const std::string& fallback) const {
  const usd::FoundValue value = input(shader, name);
  return value.value.as_text() ? *value.value.as_text() : fallback;
}

float ShaderNetwork::number(const Prim& shader, const std::string& name, float fallback) const {
  return number(source(shader, name), fallback);
}

float ShaderNetwork::number(const Source& source, float fallback) const {
  const usd::Value found = value(source).value;
  const auto number = found.as_number();
  return number && !found.is_array() && std::isfinite(*number) ? static_cast<float>(*number)
                                                               : fallback;
}

bool ShaderNetwork::boolean(const Prim& shader, const std::string& name, bool fallback) const {
  return input(shader, name).value.as_bool().value_or(fallback);
}

Vec2f ShaderNetwork::pair(const Prim& shader, const std::string& name,
                          const Vec2f& fallback) const {
  std::array<double, 2> value{};
  if (!input(shader, name).value.read(value)) return fallback;
  const Vec2f pair(static_cast<float>(value[0]), static_cast<float>(value[1]));
  return pair.allFinite() ? pair : fallback;
}

Vec3f ShaderNetwork::color(const Prim& shader, const std::string& name,
                           const Vec3f& fallback) const {
  return color(source(shader, name), fallback);
}

Vec3f ShaderNetwork::color(const Source& source, const Vec3f& fallback) const {
  const auto color = to_color(value(source).value);
  return color && color->allFinite() ? *color : fallback;
}

}  // namespace diorama::loader_usd
