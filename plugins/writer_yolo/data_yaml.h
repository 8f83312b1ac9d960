// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace diorama {

/// What data.yaml says of a YOLO dataset.
struct DataYaml {
  std::string path;
  std::map<std::string, std::vector<std::string>> splits;  ///< "train": folders or list files.
  std::map<int, std::string> names;                        ///< Classes.
  std::vector<int> kpt_shape;
  std::optional<int> nc;  ///< Number of classes.
};

/// Reads the part of YAML that such files use: plain and quoted scalars, lists and maps in block or
/// flow style, comments. Unknown keys are passed over. Throws std::runtime_error with the line.
DataYaml parse_data_yaml(std::string_view text);

}  // namespace diorama
