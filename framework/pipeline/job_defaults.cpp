// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>

#include "framework/pipeline/job.h"
#include "framework/pipeline/job_sections.h"
#include "framework/pipeline/param_variants.h"

namespace diorama {
namespace {

Value with_defaults(const Value& given, const std::vector<ParamSpec>& specs);

Value value_or_default(const Value* given, const ParamSpec& spec) {
  const bool is_given = given && given->kind != Value::Kind::Null;
  if (spec.type == ParamType::Group) {
    return with_defaults(is_given ? *given : Value::make_map(), spec.children);
  }
  if (!given) return spec.default_value;
  if (spec.type != ParamType::List || given->kind != Value::Kind::List) return *given;
  Value list = Value::make_list();
  for (const Value& item : given->list) list.list.push_back(with_defaults(item, spec.children));
  return list;
}

/// The declared keys in declared order, then what else is given.
Value with_defaults(const Value& given, const std::vector<ParamSpec>& specs) {
  if (given.kind != Value::Kind::Map) return given;
  Value result = Value::make_map();
  for (const ParamSpec& spec : specs) {
    const ParamSpec* variant = variant_of(spec, given);
    result.set(spec.key, value_or_default(given.find(spec.key), variant ? *variant : spec));
  }
  for (const auto& [key, value] : given.map) {
    if (!result.find(key)) result.set(key, value);
  }
  return result;
}

void set_if_null(Value& map, const char* key, const Value& value) {
  const Value* now = map.find(key);
  const bool is_unset = !now || now->kind == Value::Kind::Null ||
                        (now->kind == Value::Kind::Scalar && now->scalar.empty());
  if (is_unset) map.set(key, value);
}

/// "views_#" with the entry's number.
Value name_of(const JobSection& section, const Value& entry, std::size_t index) {
  std::string name = section.default_name;
  if (name.empty()) {
    const Value* type = entry.find("type");
    return type ? *type : Value();
  }
  if (const std::size_t place = name.find('#'); place != name.npos) {
    name.replace(place, 1, std::to_string(index));
  }
  return Value::text(name);
}

Value resolved_entry(const JobSection& section, const Value& given, std::size_t index,
                     const DescribeComponent& describe) {
  Value entry = given.kind == Value::Kind::Map ? given : Value::make_map();
  std::vector<ParamSpec> specs = section.keys();
  if (section.kind) {
    if (const Value* type = entry.find("type"); type && type->kind == Value::Kind::Null) {
      entry.set("type", Value::text("null"));
    }
    if (section.default_type) set_if_null(entry, "type", Value::text(section.default_type));
    if (const Value* type = entry.find("type")) {
      if (auto own = describe(*section.kind, type->scalar)) {
        specs.insert(specs.end(), own->begin(), own->end());
      }
    }
  }
  entry = with_defaults(entry, specs);
  if (section.default_name) set_if_null(entry, "name", name_of(section, entry, index));
  if (section.kind == ComponentKind::Writer) {
    if (const Value* name = entry.find("name")) set_if_null(entry, "output_dir", *name);
  }
  return entry;
}

Value resolved_section(const JobSection& section, const Value* given,
                       const DescribeComponent& describe) {
  const bool is_given = given && given->kind != Value::Kind::Null;
  if (section.when_absent) return is_given ? *given : section.when_absent();
  if (section.type == ParamType::Group) {
    return resolved_entry(section, is_given ? *given : Value::make_map(), 0, describe);
  }
  Value list = Value::make_list();
  if (!is_given) return list;
  for (const Value& entry : given->list) {
    list.list.push_back(resolved_entry(section, entry, list.list.size(), describe));
  }
  return list;
}

}  // namespace

Value resolved_job(const Value& job, const DescribeComponent& describe) {
  Value result = Value::make_map();
  for (const ParamSpec& spec : plain_job_keys()) {
    result.set(spec.key, value_or_default(job.find(spec.key), spec));
  }
  for (const JobSection& section : job_sections()) {
    Value value = resolved_section(section, job.find(section.key), describe);
    if (section.is_left_out_when_empty && value.list.empty()) continue;
    result.set(section.key, std::move(value));
  }
  return result;
}

std::vector<ParamSpec> job_specs() {
  std::vector<ParamSpec> specs = plain_job_keys();
  for (const JobSection& section : job_sections()) {
    ParamSpec spec;
    spec.key = section.key;
    spec.type = section.type;
    spec.help = section.help;
    spec.default_value = section.type == ParamType::List ? Value::make_list() : Value::make_map();
    spec.children = section.keys();
    specs.push_back(std::move(spec));
  }
  return specs;
}

}  // namespace diorama
