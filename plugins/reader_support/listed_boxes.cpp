// SPDX-License-Identifier: Apache-2.0
#include "reader_support/listed_boxes.h"

#include <array>
#include <cmath>
#include <stdexcept>

namespace diorama {
namespace {

constexpr std::array kLabelKeys{"category",   "categories", "label",   "labels",      "class",
                                "class_name", "name",       "classes", "category_id", "cls"};

const Json* label_entry(const Json& object) {
  for (const char* key : kLabelKeys) {
    const auto found = object.find(key);
    if (found != object.end()) return &*found;
  }
  return nullptr;
}

}  // namespace

PixelBox box_of_json(const Json& bbox) {
  if (!bbox.is_array() || bbox.size() != 4) throw std::runtime_error("a bbox is not four numbers");
  const auto number = [&](std::size_t i) {
    const double value = bbox.at(i).get<double>();
    if (!(std::abs(value) < 1e8)) throw std::runtime_error("a bbox is beyond reason");
    return value;
  };
  constexpr double kRounding = 1e-3;
  const double x = number(0);
  const double y = number(1);
  return {int(std::floor(x + kRounding)), int(std::floor(y + kRounding)),
          int(std::ceil(x + number(2) - kRounding)), int(std::ceil(y + number(3) - kRounding))};
}

std::string label_of_json(const Json& value, const std::vector<std::string>& classes) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_number_integer()) return {};
  const auto number = whole_number<std::int64_t>(value);
  if (number >= 0 && std::size_t(number) < classes.size()) return classes[std::size_t(number)];
  return std::to_string(number);
}

std::vector<ListedBox> listed_boxes(const Json& objects, const std::vector<std::string>& classes) {
  std::vector<ListedBox> boxes;
  if (objects.is_array()) {
    for (const Json& object : objects) {
      if (!object.is_object()) throw std::runtime_error("an object is no JSON object");
      ListedBox entry;
      if (const Json* label = label_entry(object)) entry.label = label_of_json(*label, classes);
      if (object.contains("bbox")) entry.box = box_of_json(object.at("bbox"));
      boxes.push_back(std::move(entry));
    }
    return boxes;
  }
  if (!objects.is_object() || !objects.contains("bbox")) return boxes;
  const Json* labels = label_entry(objects);
  const Json& list = objects.at("bbox");
  if (labels && labels->size() != list.size()) {
    throw std::runtime_error("has " + std::to_string(list.size()) + " boxes and " +
                             std::to_string(labels->size()) + " categories");
  }
  for (std::size_t i = 0; i < list.size(); ++i) {
    ListedBox entry;
    if (labels) entry.label = label_of_json(labels->at(i), classes);
    entry.box = box_of_json(list.at(i));
    boxes.push_back(std::move(entry));
  }
  return boxes;
}

}  // namespace diorama
