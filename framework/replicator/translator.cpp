// SPDX-License-Identifier: Apache-2.0
#include "framework/replicator/translator.h"

#include <algorithm>
#include <cmath>

#include "framework/config/yaml_config.h"

namespace diorama::replicator {

Value native(std::string_view yaml) { return parse_yaml(yaml, "built-in"); }

Value texts(const std::vector<std::string>& words) {
  Value list = Value::make_list();
  for (const std::string& word : words) list.list.push_back(Value::text(word));
  return list;
}

Value numbers(const std::vector<double>& list) {
  Value value = Value::make_list();
  for (const double number : list) value.list.push_back(Value::number(number));
  return value;
}

std::string numbered(int number) { return number == 0 ? "" : "_" + std::to_string(number + 1); }

Translator::Translator(const Value& job, std::string_view builtin_job, const char* builtin_name,
                       Diagnostics& diagnostics)
    : diagnostics_(diagnostics), given_(&job), defaults_(parse_yaml(builtin_job, builtin_name)) {}

const Value& Translator::section(std::string_view key) const {
  if (const Value* given = given_->find(key)) return *given;
  const Value* built_in = defaults_.find(key);
  return built_in ? *built_in : nothing_;
}

void Translator::complain_about_unknown(const Value& map, const std::string& path,
                                        const std::vector<std::string>& known) {
  for (const auto& [key, value] : map.map) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const std::string near = nearest_name(key, known);
    diagnostics_.add(value.key_place, (path.empty() ? "" : path + ": ") + "unknown key '" + key +
                                          "'" +
                                          (near.empty() ? "" : "; did you mean '" + near + "'?"));
  }
}

void Translator::check_resolution(const std::vector<double>& resolution,
                                  const SourceLocation& place, const std::string& path) {
  const bool is_fine = resolution.size() == 2 &&
                       std::all_of(resolution.begin(), resolution.end(), [](double number) {
                         return number >= 1 && number == std::floor(number);
                       });
  if (is_fine) return;
  diagnostics_.add(place, path + ": expected [width, height] in whole pixels");
}

Value Translator::object_entry(const Value& source, const char* type, const std::string& name,
                               const std::string& under, int count,
                               double gravity_disabled_chance) {
  Value entry = Value::make_map();
  entry.place = source.place;
  entry.set("type", Value::text(type));
  entry.set("name", Value::text(name));
  entry.set("under", Value::text(under));
  entry.set("count", Value::integer(count));
  entry.set("gravity_disabled_chance", Value::number(gravity_disabled_chance));
  return entry;
}

Value Translator::writer_entry(const Value& type, const Value* kwargs, const SourceLocation& place,
                               const std::string& kwargs_path) {
  Value entry = Value::make_map();
  entry.place = place;
  entry.set("type", type);
  entry.set("name", Value::text(type.scalar + numbered(writer_uses_[type.scalar]++)));
  entry.set("output_dir", Value::text("_out_" + entry.find("name")->scalar));
  if (!kwargs || kwargs->kind == Value::Kind::Null) return entry;
  if (kwargs->kind != Value::Kind::Map) {
    diagnostics_.add(kwargs->place,
                     kwargs_path + ": expected a mapping, found " + kwargs->describe());
    return entry;
  }
  for (const auto& [key, value] : kwargs->map) {
    const bool is_own_name = key == "type" || key == "name";
    if (is_own_name) {
      diagnostics_.add(value.key_place, kwargs_path + ": unknown key '" + key + "'");
    } else if (key != "output_dir" || value.kind != Value::Kind::Null) {
      entry.set(key, value);
    }
  }
  return entry;
}

void Translator::set_writers(Value list) {
  std::string records;
  for (const Value& entry : list.list) {
    if (const Value* folder = entry.find("output_dir"); folder && records.empty()) {
      records = folder->scalar;
    }
  }
  set("writers", std::move(list));
  Value output = native("{folder: .}");
  output.set("records", Value::text(records.empty() ? "_out_diorama" : records));
  set("output", std::move(output));
}

}  // namespace diorama::replicator
