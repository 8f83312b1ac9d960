// SPDX-License-Identifier: Apache-2.0
#include "writer_support/named_keypoints.h"

#include <algorithm>

namespace diorama {
namespace {

void add_new(const std::string& name, std::vector<std::string>& names) {
  if (std::ranges::find(names, name) == names.end()) names.push_back(name);
}

}  // namespace

void NamedKeypoints::begin(const DatasetInfo& dataset, const TrainingData& training) {
  by_class_.assign(training.classes().size(), {});
  for (const auto& [labels, names] : dataset.keypoints) {
    for (const int index : training.classes_of({labels})) {
      for (const std::string& name : names) add_new(name, by_class_[std::size_t(index)]);
    }
  }
  all_.clear();
  for (const auto& names : by_class_) {
    for (const std::string& name : names) add_new(name, all_);
  }
}

ImagePoint named_point(const Frame& frame, const Instance& instance, const std::string& name) {
  const auto point = std::ranges::find(instance.keypoints, name, &Keypoint::name);
  if (point == instance.keypoints.end()) return {};
  return image_point(frame, instance.world_from_node * point->position);
}

}  // namespace diorama
