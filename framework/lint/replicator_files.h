// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>

#include "framework/lint/dataset_files.h"
#include "framework/lint/lens.h"

namespace diorama::lint {

/// Orders texts of digits by value: 9999 comes before 10000.
struct NumberLess {
  bool operator()(const std::string& a, const std::string& b) const;
};

/// The files of one BasicWriter dataset, told apart by their names alone.
class ReplicatorFiles {
 public:
  explicit ReplicatorFiles(const Dataset& dataset);

  /// Render products; "" when the files lie flat.
  const std::set<std::string>& products() const { return products_; }
  const std::set<std::string, NumberLess>& numbers() const { return numbers_; }
  /// Kinds that the dataset holds: "rgb.png", "bounding_box_3d_labels.json".
  const std::set<std::string>& kinds() const { return kinds_; }
  /// Empty when there is none.
  std::string path(const std::string& product, const std::string& number,
                   const std::string& kind) const;

 private:
  std::set<std::string> products_;
  std::set<std::string, NumberLess> numbers_;
  std::set<std::string> kinds_;
  std::map<std::string, std::string> paths_;
};

/// A camera as camera_params_NNNN.json describes it.
struct ReplicatorCamera {
  Affine camera_from_world = Affine::Identity();  ///< In the axes of lens.h.
  Lens lens;
};

/// Throws when keys are missing.
ReplicatorCamera camera_of(const Json& camera_params);

}  // namespace diorama::lint
