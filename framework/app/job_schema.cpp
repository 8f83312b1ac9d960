// SPDX-License-Identifier: Apache-2.0
#include "framework/app/job_schema.h"

#include <cmath>
#include <optional>
#include <utility>

#include "framework/pipeline/job_sections.h"
#include "framework/pipeline/param_variants.h"

namespace diorama {
namespace {

Value words(const std::vector<std::string>& texts) {
  Value list = Value::make_list();
  for (const std::string& text : texts) list.list.push_back(Value::text(text));
  return list;
}

Value typed(const std::vector<std::string>& types) {
  Value schema = Value::make_map();
  schema.set("type", types.size() == 1 ? Value::text(types.front()) : words(types));
  return schema;
}

/// Any scalar reads as text.
Value text_schema() { return typed({"string", "number", "boolean"}); }

Value number_schema(const char* type, const ParamSpec& spec) {
  Value schema = typed({type});
  if (std::isfinite(spec.min)) schema.set("minimum", Value::number(spec.min));
  if (std::isfinite(spec.max)) schema.set("maximum", Value::number(spec.max));
  return schema;
}

Value list_schema(Value items, std::optional<int> count) {
  Value schema = typed({"array"});
  schema.set("items", std::move(items));
  if (count) {
    schema.set("minItems", Value::integer(*count));
    schema.set("maxItems", Value::integer(*count));
  }
  return schema;
}

Value any_of(std::vector<Value> choices) {
  Value list = Value::make_list();
  list.list = std::move(choices);
  Value schema = Value::make_map();
  schema.set("anyOf", std::move(list));
  return schema;
}

/// Distributions hold distributions, so they stand once per range among the schema's definitions.
class DistributionSchemas {
 public:
  Value reference(const ParamSpec& spec, bool is_vector) {
    const std::string range = bound_name(spec.min) + "_" + bound_name(spec.max);
    const std::string name = (is_vector ? "vector_" : "number_") + range;
    if (!definitions_.find(name)) {
      definitions_.set(name, Value());  // it refers to itself
      definitions_.set(name, is_vector ? vectors(spec, name) : numbers(spec, name));
    }
    return reference_to(name);
  }
  Value texts() {
    if (!definitions_.find("texts")) {
      const Value list = list_schema(text_schema(), std::nullopt);
      definitions_.set(
          "texts", any_of({text_schema(), list,
                           forms({choice("choices", text_schema()), sequence(text_schema())})}));
    }
    return reference_to("texts");
  }
  Value take() { return std::exchange(definitions_, Value::make_map()); }

 private:
  /// A word such as `uniform` and what stands below it.
  using Form = std::pair<std::string, Value>;

  static std::string bound_name(double bound) {
    return std::isfinite(bound) ? Value::number(bound).scalar : "any";
  }
  static Value reference_to(const std::string& name) {
    Value schema = Value::make_map();
    schema.set("$ref", Value::text("#/$defs/" + name));
    return schema;
  }
  /// A mapping with exactly these keys, apart from the optional one.
  static Value keys(std::vector<Form> properties, const std::string& optional = {}) {
    Value schema = typed({"object"});
    Value required = Value::make_list();
    Value all = Value::make_map();
    for (auto& [key, value] : properties) {
      if (key != optional) required.list.push_back(Value::text(key));
      all.set(key, std::move(value));
    }
    schema.set("properties", std::move(all));
    schema.set("required", std::move(required));
    schema.set("additionalProperties", Value::boolean(false));
    return schema;
  }
  static Form choice(const std::string& key, Value item) {
    ParamSpec weight;
    weight.min = 0.0;
    Value weights = list_schema(number_schema("number", weight), std::nullopt);
    return {"choice",
            keys({{key, some(std::move(item))}, {"weights", std::move(weights)}}, "weights")};
  }
  static Form sequence(Value item) {
    return {"sequence", keys({{"items", some(std::move(item))}})};
  }
  static Value some(Value item) {
    Value list = list_schema(std::move(item), std::nullopt);
    list.set("minItems", Value::integer(1));
    return list;
  }
  /// One of the words, bare or in Replicator's way.
  static Value forms(std::vector<Form> forms) {
    Value properties = Value::make_map();
    for (const auto& [word, body] : forms) {
      properties.set(word, body);
      properties.set("distribution." + word, body);
    }
    Value schema = typed({"object"});
    schema.set("properties", std::move(properties));
    schema.set("additionalProperties", Value::boolean(false));
    schema.set("minProperties", Value::integer(1));
    schema.set("maxProperties", Value::integer(1));
    return schema;
  }
  /// The forms that numbers and vectors share; `point` is a number or a vector of such numbers.
  template <class Point>
  static std::vector<Form> drawn(const ParamSpec& spec, const Point& point,
                                 const std::string& name) {
    const Value number = number_schema("number", spec);
    Value positive = number;
    if (spec.min <= 0.0) positive.set("exclusiveMinimum", Value::integer(0));
    ParamSpec deviation;
    deviation.min = 0.0;
    return {{"uniform", keys({{"lower", point(number)}, {"upper", point(number)}})},
            {"log_uniform", keys({{"lower", point(positive)}, {"upper", point(positive)}})},
            {"normal",
             keys({{"mean", point(number)}, {"std", point(number_schema("number", deviation))}})},
            choice("choices", reference_to(name)),
            sequence(reference_to(name))};
  }
  static Value numbers(const ParamSpec& spec, const std::string& name) {
    const Value number = number_schema("number", spec);
    const auto point = [](const Value& of) { return of; };
    return any_of({number, list_schema(number, 2), forms(drawn(spec, point, name))});
  }
  Value vectors(const ParamSpec& spec, const std::string& name) {
    const Value axis = reference(spec, false);
    const auto point = [](const Value& of) { return any_of({of, list_schema(of, 3)}); };
    std::vector<Form> words = drawn(spec, point, name);
    words.emplace_back("combine", keys({{"distributions", list_schema(axis, 3)}}));
    const Value number = number_schema("number", spec);
    return any_of({number, list_schema(number, 2), list_schema(axis, 3), forms(std::move(words))});
  }

  Value definitions_ = Value::make_map();
};

/// Turns declared parameters into schemas.
class Schemas {
 public:
  Value of(const ParamSpec& spec);
  Value properties(const std::vector<ParamSpec>& specs);
  /// Rules for parameters whose keys depend on their neighbours; an empty list when there are none.
  Value variants(const std::vector<ParamSpec>& specs);
  Value definitions() { return distributions_.take(); }

 private:
  Value mapping(const std::vector<ParamSpec>& specs);
  Value bare(const ParamSpec& spec);
  DistributionSchemas distributions_;
};

Value Schemas::mapping(const std::vector<ParamSpec>& specs) {
  Value schema = typed({"object"});
  schema.set("properties", properties(specs));
  schema.set("additionalProperties", Value::boolean(false));
  return schema;
}

Value Schemas::bare(const ParamSpec& spec) {
  switch (spec.type) {
    case ParamType::Bool:
      return typed({"boolean"});
    case ParamType::Int:
      return number_schema("integer", spec);
    case ParamType::Number:
      return number_schema("number", spec);
    case ParamType::Text:
      return text_schema();
    case ParamType::Interval:
      return any_of({number_schema("number", spec), list_schema(number_schema("number", spec), 2)});
    case ParamType::Vector:
      return list_schema(number_schema("number", spec), 3);
    case ParamType::TextList:
      return list_schema(text_schema(), std::nullopt);
    case ParamType::NumberList:
      return list_schema(number_schema("number", spec), std::nullopt);
    case ParamType::OptionalNumber:
      return any_of({number_schema("number", spec), typed({"null"})});
    case ParamType::OptionalText:
      return typed({"string", "number", "boolean", "null"});
    case ParamType::Distribution:
      return distributions_.reference(spec, false);
    case ParamType::VectorDistribution:
      return distributions_.reference(spec, true);
    case ParamType::OptionalDistribution:
      return any_of({distributions_.reference(spec, false), typed({"null"})});
    case ParamType::OptionalVectorDistribution:
      return any_of({distributions_.reference(spec, true), typed({"null"})});
    case ParamType::TextDistribution:
      return any_of({distributions_.texts(), typed({"null"})});
    case ParamType::Any:
      return Value::make_map();
    case ParamType::Group:
      return mapping(spec.children);
    case ParamType::List:
      return list_schema(mapping(spec.children), std::nullopt);
    case ParamType::Choice:
      break;
  }
  Value schema = Value::make_map();
  schema.set("enum", words(spec.choices));
  return schema;
}

Value Schemas::of(const ParamSpec& spec) {
  Value schema = bare(spec);
  schema.set("description",
             Value::text(spec.unit.empty() ? spec.help : spec.help + " [" + spec.unit + "]"));
  if (spec.type != ParamType::Group && spec.type != ParamType::List) {
    schema.set("default", spec.default_value);
  }
  return schema;
}

Value Schemas::properties(const std::vector<ParamSpec>& specs) {
  Value properties = Value::make_map();
  for (const ParamSpec& spec : specs) properties.set(spec.key, of(spec));
  return properties;
}

Value Schemas::variants(const std::vector<ParamSpec>& specs) {
  Value rules = Value::make_list();
  for (const ParamSpec& spec : specs) {
    if (spec.type != ParamType::Any) continue;
    for (const ParamSpec& variant : spec.children) {
      Value values = Value::make_map();
      Value keys = Value::make_list();
      for (const auto& [key, value] : conditions_of(variant)) {
        Value constant = Value::make_map();
        constant.set("const", Value::text(value));
        values.set(key, std::move(constant));
        keys.list.push_back(Value::text(key));
      }
      Value condition = Value::make_map();
      condition.set("properties", std::move(values));
      condition.set("required", std::move(keys));
      Value meant = Value::make_map();
      meant.set(spec.key, of(variant));
      Value then = Value::make_map();
      then.set("properties", std::move(meant));
      Value rule = Value::make_map();
      rule.set("if", std::move(condition));
      rule.set("then", std::move(then));
      rules.list.push_back(std::move(rule));
    }
  }
  return rules;
}

/// `type: null` is what people write for the renderer called "null".
Value type_is(const std::string& type) {
  Value schema = Value::make_map();
  if (type != "null") {
    schema.set("const", Value::text(type));
    return schema;
  }
  Value both = Value::make_list();
  both.list = {Value::text("null"), Value()};
  schema.set("enum", std::move(both));
  return schema;
}

Value required(const char* key) {
  Value list = Value::make_list();
  list.list.push_back(Value::text(key));
  return list;
}

/// If the entry has this type, then it has these keys and no others.
Value rule_for(const JobSection& section, const std::vector<ParamSpec>& host,
               const DescribedComponent& component, Schemas& schemas) {
  Value types = Value::make_map();
  types.set("type", type_is(component.type));
  Value condition = Value::make_map();
  condition.set("properties", std::move(types));
  const bool is_default = section.default_type && component.type == section.default_type;
  if (!is_default) condition.set("required", required("type"));

  Value properties = schemas.properties(component.params);
  for (const ParamSpec& spec : host) properties.set(spec.key, schemas.of(spec));
  properties.set("type", type_is(component.type));
  Value keys = Value::make_map();
  keys.set("description", Value::text(component.help));
  keys.set("properties", std::move(properties));
  keys.set("additionalProperties", Value::boolean(false));
  Value variants = schemas.variants(component.params);
  if (!variants.list.empty()) keys.set("allOf", std::move(variants));

  Value rule = Value::make_map();
  rule.set("if", std::move(condition));
  rule.set("then", std::move(keys));
  return rule;
}

Value entry_schema(const JobSection& section, const std::vector<ParamSpec>& host,
                   const std::vector<DescribedComponent>& components, Schemas& schemas) {
  Value rules = Value::make_list();
  Value types = Value::make_list();
  const auto allow = [&](const DescribedComponent& component) {
    types.list.push_back(Value::text(component.type));
    if (component.type == "null") types.list.emplace_back();
    rules.list.push_back(rule_for(section, host, component, schemas));
  };
  for (const DescribedComponent& component : components) {
    if (component.kind == section.kind) allow(component);
  }
  if (section.kind == ComponentKind::Physics) {
    allow({*section.kind, "none", "Nothing moves by itself.", {}});
  }
  Value type = Value::make_map();
  type.set("description", Value::text("Type of the component."));
  type.set("enum", std::move(types));
  Value properties = Value::make_map();
  properties.set("type", std::move(type));

  Value schema = typed({"object"});
  schema.set("properties", std::move(properties));
  if (!section.default_type) schema.set("required", required("type"));
  if (!rules.list.empty()) schema.set("allOf", std::move(rules));
  return schema;
}

/// Sections may be left empty.
Value or_null(Value schema) {
  Value types = Value::make_list();
  types.list = {*schema.find("type"), Value::text("null")};
  schema.set("type", std::move(types));
  return schema;
}

}  // namespace

Value job_schema(const std::vector<ParamSpec>& job,
                 const std::vector<DescribedComponent>& components) {
  Schemas schemas;
  Value properties = Value::make_map();
  for (const ParamSpec& spec : job) {
    const JobSection* section = job_section(spec.key);
    Value schema;
    if (section && section->kind) {
      schema = entry_schema(*section, spec.children, components, schemas);
      if (spec.type == ParamType::List) schema = list_schema(std::move(schema), std::nullopt);
      schema.set("description", Value::text(spec.help));
    } else {
      schema = schemas.of(spec);
    }
    const bool is_section = spec.type == ParamType::List || spec.type == ParamType::Group;
    properties.set(spec.key, is_section ? or_null(std::move(schema)) : std::move(schema));
  }
  // There must be something to visit.
  Value& environments = *properties.find("environments");
  environments.set("type", Value::text("array"));
  environments.set("minItems", Value::integer(1));

  Value schema = Value::make_map();
  schema.set("$schema", Value::text("https://json-schema.org/draft/2020-12/schema"));
  schema.set("title", Value::text("Diorama job"));
  schema.set("type", Value::text("object"));
  schema.set("properties", std::move(properties));
  schema.set("required", required("environments"));
  schema.set("additionalProperties", Value::boolean(false));
  schema.set("$defs", schemas.definitions());
  return schema;
}

}  // namespace diorama
