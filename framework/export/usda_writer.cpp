// SPDX-License-Identifier: Apache-2.0
#include "framework/export/usda_writer.h"

#include <charconv>
#include <type_traits>

namespace diorama::usd_export {
namespace {

template <class Number>
void put_number(std::string& out, Number value) {
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  out.append(text.data(), end);
}

void put_string(std::string& out, const std::string& text) {
  out += '"';
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (c == '\n') {
      out += "\\n";
    } else {
      out += c;
    }
  }
  out += '"';
}

template <class List>
void put_tuple(std::string& out, const List& list, std::size_t from, std::size_t count) {
  out += '(';
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0) out += ", ";
    put_number(out, list[from + i]);
  }
  out += ')';
}

void put(std::string& out, bool value) { out += value ? "true" : "false"; }
void put(std::string& out, int value) { put_number(out, value); }
void put(std::string& out, float value) { put_number(out, value); }
void put(std::string& out, double value) { put_number(out, value); }
void put(std::string& out, const std::string& text) { put_string(out, text); }
void put(std::string& out, const Token& token) { put_string(out, token.text); }
void put(std::string& out, const AssetPath& path) { out += "@" + path.text + "@"; }
void put(std::string& out, const Vec2f& v) { put_tuple(out, v.data(), 0, 2); }
void put(std::string& out, const Vec3f& v) { put_tuple(out, v.data(), 0, 3); }
void put(std::string& out, const Float4& v) { put_tuple(out, v, 0, 4); }
void put(std::string& out, const Eigen::Quaternionf& q) {
  put_tuple(out, std::array{q.w(), q.x(), q.y(), q.z()}, 0, 4);
}
void put(std::string& out, const Double3& v) { put_tuple(out, v, 0, 3); }
void put(std::string& out, const Matrix& m) {
  out += "( ";
  for (std::size_t row = 0; row < 4; ++row) {
    if (row > 0) out += ", ";
    put_tuple(out, m, 4 * row, 4);
  }
  out += " )";
}
template <class Item>
void put(std::string& out, const std::vector<Item>& list) {
  out += '[';
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (i > 0) out += ", ";
    put(out, list[i]);
  }
  out += ']';
}

void put_targets(std::string& out, const std::vector<std::string>& targets) {
  if (targets.size() == 1) {
    out += "<" + targets[0] + ">";
    return;
  }
  out += '[';
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (i > 0) out += ", ";
    out += "<" + targets[i] + ">";
  }
  out += ']';
}

void put_property(std::string& out, const Property& property, const std::string& indent) {
  if (property.type.empty()) {
    out += indent + "rel " + property.name + " = ";
    put_targets(out, property.targets);
    out += '\n';
    return;
  }
  std::string head = indent;
  if (property.is_custom) head += "custom ";
  if (property.is_uniform) head += "uniform ";
  head += property.type + " " + property.name;
  if (property.value || property.targets.empty()) {
    out += head;
    if (property.value) {
      out += " = ";
      std::visit([&out](const auto& value) { put(out, value); }, *property.value);
    }
    if (!property.interpolation.empty()) {
      out += " (\n" + indent + "    interpolation = \"" + property.interpolation + "\"\n" + indent +
             ")";
    }
    out += '\n';
  }
  if (property.targets.empty()) return;
  out += head + ".connect = ";
  put_targets(out, property.targets);
  out += '\n';
}

void put_prim(std::string& out, const Prim& prim, const std::string& indent) {
  out += indent + "def " + (prim.type.empty() ? "" : prim.type + " ") + "\"" + prim.name + "\"";
  if (!prim.api_schemas.empty() || !prim.kind.empty()) {
    out += " (\n";
    if (!prim.api_schemas.empty()) {
      out += indent + "    prepend apiSchemas = [";
      for (std::size_t i = 0; i < prim.api_schemas.size(); ++i) {
        if (i > 0) out += ", ";
        put_string(out, prim.api_schemas[i]);
      }
      out += "]\n";
    }
    if (!prim.kind.empty()) out += indent + "    kind = \"" + prim.kind + "\"\n";
    out += indent + ")";
  }
  out += "\n" + indent + "{\n";
  for (const Property& property : prim.properties) put_property(out, property, indent + "    ");
  for (const Prim& child : prim.children) {
    out += '\n';
    put_prim(out, child, indent + "    ");
  }
  out += indent + "}\n";
}

}  // namespace

std::string write_usda(const Layer& layer) {
  std::string out = "#usda 1.0\n(\n";
  if (!layer.roots.empty()) out += "    defaultPrim = \"" + layer.roots[0].name + "\"\n";
  out += "    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n";
  for (const Prim& prim : layer.roots) {
    out += '\n';
    put_prim(out, prim, "");
  }
  return out;
}

}  // namespace diorama::usd_export
