// SPDX-License-Identifier: Apache-2.0
#include "diorama/config.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>

namespace diorama {

std::string SourceLocation::text() const {
  if (line <= 0) return file;
  return file + ":" + std::to_string(line) + ":" + std::to_string(column);
}

Value::Value() = default;
Value::~Value() = default;
Value::Value(const Value&) = default;
Value::Value(Value&&) noexcept = default;
Value& Value::operator=(const Value&) = default;
Value& Value::operator=(Value&&) noexcept = default;

const Value* Value::find(std::string_view key) const {
  if (kind != Kind::Map) return nullptr;
  for (const auto& [name, value] : map) {
    if (name == key) return &value;
  }
  return nullptr;
}

Value* Value::find(std::string_view key) {
  return const_cast<Value*>(static_cast<const Value*>(this)->find(key));
}

Value& Value::set(std::string_view key, Value value) {
  if (kind == Kind::Null) kind = Kind::Map;
  if (kind != Kind::Map) {
    throw Error(ErrorKind::Internal,
                "Value::set('" + std::string(key) + "'): expected a mapping, found " + describe());
  }
  if (Value* old = find(key)) return *old = std::move(value);
  return map.emplace_back(std::string(key), std::move(value)).second;
}

void Value::erase(std::string_view key) {
  std::erase_if(map, [key](const auto& entry) { return entry.first == key; });
}

Value Value::text(std::string_view text) {
  Value value;
  value.kind = Kind::Scalar;
  value.scalar = text;
  value.is_quoted = true;
  return value;
}

namespace {

Value plain(std::string text) {
  Value value = Value::text(text);
  value.is_quoted = false;
  return value;
}

}  // namespace

Value Value::number(double value) {
  if (std::isnan(value)) return plain(".nan");
  if (std::isinf(value)) return plain(value > 0 ? ".inf" : "-.inf");
  char digits[32];  // the shortest text that reads back as the same number
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  return plain(std::string(digits, end));
}

Value Value::integer(std::int64_t value) { return plain(std::to_string(value)); }
Value Value::boolean(bool value) { return plain(value ? "true" : "false"); }

Value Value::make_map() {
  Value value;
  value.kind = Kind::Map;
  return value;
}

Value Value::make_list() {
  Value value;
  value.kind = Kind::List;
  return value;
}

std::string Value::describe() const {
  constexpr std::size_t kLongest = 60;
  switch (kind) {
    case Kind::Null:
      return "nothing";
    case Kind::List:
      return list.empty() ? "an empty list" : "a list";
    case Kind::Map:
      return "a mapping";
    case Kind::Scalar:
      break;
  }
  const bool is_long = scalar.size() > kLongest;
  const std::string shown = is_long ? scalar.substr(0, kLongest) + "..." : scalar;
  return (is_quoted ? "the text '" : "'") + shown + "'";
}

void Diagnostics::add(const SourceLocation& place, std::string_view message) {
  const std::string where = place.text();
  messages_.push_back((where.empty() ? "" : where + ": ") + std::string(message));
}

void Diagnostics::raise() const {
  if (messages_.empty()) return;
  std::string all;
  for (const std::string& message : messages_) all += (all.empty() ? "" : "\n") + message;
  throw Error(ErrorKind::Config, all);
}

namespace {

char lower(char c) { return char(std::tolower(static_cast<unsigned char>(c))); }

/// Insertions, deletions, replacements and swaps of neighbours (optimal string alignment), upper
/// and lower case being the same.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> two_ago(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::swap(two_ago, last);
    std::swap(last, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const bool is_same = lower(a[i - 1]) == lower(b[j - 1]);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (is_same ? 0 : 1)});
      const bool is_swap = i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
                           lower(a[i - 2]) == lower(b[j - 1]);
      if (is_swap) row[j] = std::min(row[j], two_ago[j - 2] + 1);
    }
  }
  return row[b.size()];
}

}  // namespace

std::string nearest_name(std::string_view name, const std::vector<std::string>& names) {
  std::size_t best_distance = std::max<std::size_t>(1, name.size() / 3) + 1;
  std::string best;
  for (const std::string& candidate : names) {
    const std::size_t longer = std::max(name.size(), candidate.size());
    const std::size_t shorter = std::min(name.size(), candidate.size());
    if (longer - shorter >= best_distance) continue;  // also spares hostile keys of great length
    const std::size_t distance = edit_distance(name, candidate);
    if (distance >= best_distance || distance >= longer) continue;
    best_distance = distance;
    best = candidate;
  }
  return best;
}

}  // namespace diorama
