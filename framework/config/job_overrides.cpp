// SPDX-License-Identifier: Apache-2.0
#include "framework/config/job_overrides.h"

#include <algorithm>
#include <charconv>
#include <string>
#include <vector>

#include "framework/config/yaml_config.h"

namespace diorama {
namespace {

[[noreturn]] void refuse(std::string_view assignment, const std::string& message) {
  throw Error(ErrorKind::Usage, "--set " + std::string(assignment) + ": " + message);
}

/// "cameras[0].width", as messages spell it, and "cameras.0.width" are the same.
std::vector<std::string> split(std::string_view path, std::string_view assignment) {
  std::vector<std::string> parts;
  for (;;) {
    const std::size_t end = std::min(path.find_first_of(".["), path.size());
    parts.emplace_back(path.substr(0, end));
    path.remove_prefix(end);
    while (path.starts_with('[')) {
      const std::size_t close = path.find(']');
      const std::size_t next = close == std::string_view::npos ? close : close + 1;
      if (next > path.size() || (next < path.size() && path[next] != '.' && path[next] != '[')) {
        refuse(assignment, "expected entries of lists as in cameras[0].width");
      }
      parts.emplace_back(path.substr(1, close - 1));
      path.remove_prefix(next);
    }
    if (path.empty()) return parts;
    path.remove_prefix(1);
  }
}

std::string entry_name(const Value& entry) {
  for (const char* key : {"name", "type"}) {
    const Value* found = entry.find(key);
    if (found && found->kind == Value::Kind::Scalar) return found->scalar;
  }
  return {};
}

/// The entry of `list` that `part` means: an index, or the name of an entry.
Value& list_entry(Value& list, const std::string& part, std::string_view assignment,
                  const std::string& path) {
  std::size_t index = 0;
  const char* end = part.data() + part.size();
  const auto [stop, failed] = std::from_chars(part.data(), end, index);
  if (failed == std::errc() && stop == end) {
    if (index < list.list.size()) return list.list[index];
    refuse(assignment, path + " has " + std::to_string(list.list.size()) +
                           (list.list.size() == 1 ? " entry" : " entries") +
                           ", counted from 0; there is no entry " + part);
  }
  Value* found = nullptr;
  std::vector<std::string> names;
  for (Value& entry : list.list) {
    const std::string name = entry_name(entry);
    if (!name.empty()) names.push_back(name);
    if (name != part) continue;
    if (found)
      refuse(assignment, path + " has several entries called '" + part + "'; use an index from 0");
    found = &entry;
  }
  if (found) return *found;
  std::string known;
  for (const std::string& name : names) known += (known.empty() ? "" : ", ") + name;
  refuse(assignment,
         path + " has no entry called '" + part + "'" +
             (known.empty() ? std::string("; use an index from 0") : "; it has: " + known));
}

}  // namespace

void merge(Value& base, const Value& over) {
  if (base.kind != Value::Kind::Map || over.kind != Value::Kind::Map) {
    base = over;
    return;
  }
  for (const auto& [key, value] : over.map) {
    if (Value* known = base.find(key)) {
      merge(*known, value);
    } else {
      base.map.emplace_back(key, value);
    }
  }
}

void apply_set(Value& job, std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    refuse(assignment, "expected key=value, for instance renderer.samples=64");
  }
  Value value;
  try {
    value = parse_yaml(assignment.substr(equals + 1), "--set " + std::string(assignment));
  } catch (const Error& error) {
    throw Error(ErrorKind::Usage, error.what());
  }
  Value* at = &job;
  std::string path;
  for (const std::string& part : split(assignment.substr(0, equals), assignment)) {
    if (part.empty()) refuse(assignment, "the key has an empty part");
    const bool is_entry = at->kind == Value::Kind::List;
    if (is_entry) {
      at = &list_entry(*at, part, assignment, path);
    } else if (at->kind == Value::Kind::Scalar) {
      refuse(assignment, path + " is " + at->describe() + ", it has no key '" + part + "'");
    } else {
      Value* next = at->find(part);
      if (!next) {
        next = &at->set(part, Value());
        next->key_place = value.place;
      }
      at = next;
    }
    path += is_entry ? "[" + part + "]" : (path.empty() ? "" : ".") + part;
  }
  const SourceLocation key_place = at->key_place;
  *at = std::move(value);
  at->key_place = key_place;
}

}  // namespace diorama
