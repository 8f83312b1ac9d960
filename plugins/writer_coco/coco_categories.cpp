// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/coco_categories.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>

#include "diorama/error.h"
#include "writer_support/value_place.h"

namespace diorama {
namespace {

constexpr const char* kCategoriesKey = "coco_categories";
// Replicator's own id for what is in no category.
constexpr int kOtherId = 201;

[[noreturn]] void complain(const Value& value, const std::string& what) {
  throw Error(ErrorKind::Config, complaint_about(value, kCategoriesKey) + what);
}

std::optional<int> integer(const Value* value) {
  int number = 0;
  if (!value || value->kind != Value::Kind::Scalar) return std::nullopt;
  const char* end = value->scalar.data() + value->scalar.size();
  const auto read = std::from_chars(value->scalar.data(), end, number);
  if (read.ec != std::errc() || read.ptr != end) return std::nullopt;
  return number;
}

void read_color(const Value& entry, CocoCategory& category) {
  const Value* color = entry.find("color");
  if (!color) return;
  category.has_color = color->kind == Value::Kind::List && color->list.size() == 3;
  for (std::size_t i = 0; i < 3 && category.has_color; ++i) {
    const auto channel = integer(&color->list[i]);
    category.has_color = channel && *channel >= 0 && *channel <= 255;
    category.color[i] = channel.value_or(0);
  }
  if (!category.has_color) {
    complain(*color, "color: expected three numbers from 0 to 255, found " + color->describe());
  }
}

CocoCategory read_category(const std::string& label, const Value& entry) {
  if (entry.kind != Value::Kind::Map) {
    complain(entry, "expected {name: ..., id: ...} for '" + label + "', found " + entry.describe());
  }
  for (const auto& [key, value] : entry.map) {
    constexpr std::string_view kKnown[] = {"name", "id", "supercategory", "color", "isthing"};
    if (std::ranges::find(kKnown, key) == std::end(kKnown)) {
      complain(value, "unknown key '" + key + "' of '" + label + "'");
    }
  }
  CocoCategory category;
  category.label = label;
  const auto id = integer(entry.find("id"));
  const Value* name = entry.find("name");
  if (!id || !name || name->kind != Value::Kind::Scalar) {
    complain(entry, "'" + label + "' needs a name and a whole number as its id");
  }
  category.id = *id;
  category.name = name->scalar;
  if (const Value* group = entry.find("supercategory")) category.supercategory = group->scalar;
  if (const Value* thing = entry.find("isthing")) {
    category.is_thing = thing->scalar == "1" || thing->scalar == "true";
  }
  read_color(entry, category);
  return category;
}

}  // namespace

std::vector<CocoCategory> read_coco_categories(const Value& value) {
  std::vector<CocoCategory> categories;
  if (value.kind == Value::Kind::Null) return categories;
  if (value.kind != Value::Kind::Map || value.map.empty()) {
    complain(value, "expected a mapping of labels to categories, found " + value.describe());
  }
  std::set<int> ids;
  bool has_other = false;
  for (const auto& [label, entry] : value.map) {
    categories.push_back(read_category(label, entry));
    has_other |= label == kOtherCategory;
    if (!ids.insert(categories.back().id).second) {
      complain(entry, "id " + std::to_string(categories.back().id) + " is used twice");
    }
  }
  if (has_other) return categories;
  CocoCategory other;
  other.label = other.name = other.supercategory = kOtherCategory;
  other.id = kOtherId;
  while (ids.contains(other.id)) ++other.id;
  categories.push_back(std::move(other));
  return categories;
}

}  // namespace diorama
