// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/writer.h"
#include "writer_support/cuboid.h"
#include "writer_support/training_data.h"

namespace diorama {

/// The keypoints that a job names, by class.
class NamedKeypoints {
 public:
  /// `training` has begun.
  void begin(const DatasetInfo& dataset, const TrainingData& training);

  /// In the job's order; empty for a class without.
  const std::vector<std::string>& of_class(int class_index) const {
    return by_class_.at(std::size_t(class_index));
  }
  /// Of all classes, each once, in the order of these.
  const std::vector<std::string>& all() const { return all_; }
  bool is_empty() const { return all_.empty(); }

 private:
  std::vector<std::vector<std::string>> by_class_;
  std::vector<std::string> all_;
};

/// Where the keypoint of that name lies in the image; outside when the instance has none. Needs
/// kDistanceToCamera.
ImagePoint named_point(const Frame& frame, const Instance& instance, const std::string& name);

}  // namespace diorama
