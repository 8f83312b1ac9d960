// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

namespace diorama::loader_support {

/// The pictures that an asset names and lacks, each with the materials that want it.
class MissingPictures {
 public:
  /// `what` says file, picture and reason; the first one counts. `material` is empty where no
  /// material wants it: a sky.
  void add(const std::string& picture, const std::string& what, const std::string& material);

  /// One line per picture in the order of their first mention: `WHAT (material "NAME")`. A name in
  /// quotes is what `diorama inspect` finds the material by.
  std::vector<std::string> lines() const;
  /// Those that the lines are about.
  const std::vector<std::string>& pictures() const { return order_; }

 private:
  struct Missing {
    std::string what;
    std::vector<std::string> materials;
  };
  std::vector<std::string> order_;
  std::map<std::string, Missing> missing_;  ///< By picture.
};

}  // namespace diorama::loader_support
