// SPDX-License-Identifier: Apache-2.0
#include "framework/app/param_text.h"

#include <cmath>

#include "framework/config/value_text.h"

namespace diorama {
namespace {

/// On one line, as it could stand in a job.
std::string default_text(const Value& value) {
  if (value.kind == Value::Kind::List || value.kind == Value::Kind::Map) return to_json(value, 0);
  std::string text = to_yaml(value);
  text.pop_back();
  return text;
}

void add_rows(const std::vector<ParamSpec>& specs, const std::string& front,
              std::vector<ParamRow>& rows) {
  for (const ParamSpec& spec : specs) {
    const bool has_children = spec.type == ParamType::Group || spec.type == ParamType::List;
    const std::string text = has_children ? std::string() : default_text(spec.default_value);
    const std::string key = front + spec.key;
    rows.push_back({key, type_text(spec), text, range_text(spec), spec.unit, spec.help});
    if (spec.type == ParamType::Any) {
      for (const ParamSpec& variant : spec.children) {
        rows.push_back({key + " of " + variant.key, type_text(variant), {}, {}, {}, variant.help});
        add_rows(variant.children, key + ".", rows);
      }
      continue;
    }
    add_rows(spec.children, key + (spec.type == ParamType::List ? "[]." : "."), rows);
  }
}

std::string number_text(double number) { return Value::number(number).scalar; }

}  // namespace

std::string type_text(const ParamSpec& spec) {
  switch (spec.type) {
    case ParamType::Bool:
      return "boolean";
    case ParamType::Int:
      return "integer";
    case ParamType::Number:
      return "number";
    case ParamType::Text:
      return "text";
    case ParamType::Interval:
      return "[lo, hi] or number";
    case ParamType::Vector:
      return "[x, y, z]";
    case ParamType::TextList:
      return "list of texts";
    case ParamType::NumberList:
      return "list of numbers";
    case ParamType::OptionalNumber:
      return "number or null";
    case ParamType::OptionalText:
      return "text or null";
    case ParamType::Distribution:
      return "number or distribution";
    case ParamType::VectorDistribution:
      return "[x, y, z], number or distribution";
    case ParamType::OptionalDistribution:
      return "number, distribution or null";
    case ParamType::OptionalVectorDistribution:
      return "[x, y, z], number, distribution or null";
    case ParamType::TextDistribution:
      return "text, list of texts, choice or sequence";
    case ParamType::Any:
      return "any";
    case ParamType::Group:
      return "mapping";
    case ParamType::List:
      return "list of mappings";
    case ParamType::Choice:
      break;
  }
  std::string text;
  for (const std::string& word : spec.choices) text += (text.empty() ? "one of: " : ", ") + word;
  return text;
}

std::string range_text(const ParamSpec& spec) {
  const bool has_min = std::isfinite(spec.min);
  const bool has_max = std::isfinite(spec.max);
  if (has_min && has_max) return number_text(spec.min) + " to " + number_text(spec.max);
  if (has_min) return ">= " + number_text(spec.min);
  if (has_max) return "<= " + number_text(spec.max);
  return {};
}

std::vector<ParamRow> param_rows(const std::vector<ParamSpec>& specs) {
  std::vector<ParamRow> rows;
  add_rows(specs, {}, rows);
  return rows;
}

Value param_values(const std::vector<ParamSpec>& specs) {
  Value list = Value::make_list();
  for (const ParamSpec& spec : specs) {
    Value item = Value::make_map();
    item.set("key", Value::text(spec.key));
    item.set("type", Value::text(type_text(spec)));
    item.set("default", spec.default_value);
    if (std::isfinite(spec.min)) item.set("min", Value::number(spec.min));
    if (std::isfinite(spec.max)) item.set("max", Value::number(spec.max));
    if (!spec.unit.empty()) item.set("unit", Value::text(spec.unit));
    item.set("help", Value::text(spec.help));
    if (!spec.choices.empty()) {
      Value words = Value::make_list();
      for (const std::string& word : spec.choices) words.list.push_back(Value::text(word));
      item.set("choices", std::move(words));
    }
    if (!spec.children.empty()) item.set("children", param_values(spec.children));
    list.list.push_back(std::move(item));
  }
  return list;
}

}  // namespace diorama
