// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "diorama/config.h"

namespace diorama {

/// An entry of COCO's list of categories.
struct CocoCategory {
  std::string label;  ///< Of the objects.
  int id = 0;
  std::string name;
  std::string supercategory = "object";
  bool is_thing = true;
  std::array<int, 3> color{};
  bool has_color = false;
};

/// The label that stands for all labels which are not in a list of categories.
inline constexpr const char* kOtherCategory = "other";

/// Labelled "1" by this name is what a dataset that no job made calls a crowd.
inline constexpr const char* kCrowdLabel = "iscrowd";

/// Replicator's `coco_categories`: label -> {name, id, supercategory, color, isthing}, of which
/// name and id are required. The category "other" is added if it is not there. Empty for null.
/// Throws Error(Config) that says where.
std::vector<CocoCategory> read_coco_categories(const Value& value);

}  // namespace diorama
