// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "framework/lint/dataset_files.h"

namespace diorama::lint {

/// One camera's picture in one capture, as dataset.json plans it.
struct PlannedPicture {
  std::string split;  ///< "train" or "val".
  int capture = 0;
  int camera = 0;
  std::string stem;  ///< "000012_cam_0".
};

/// What dataset.json says.
struct DatasetPage {
  std::vector<std::string> classes;
  std::vector<PlannedPicture> pictures;  ///< In order of captures and cameras.
  int cameras = 0;
  Json conventions = Json::object();
};

/// Checks that conventions, origin and split are stated and make sense. Empty when the page is
/// damaged.
DatasetPage lint_page(Dataset& dataset);

}  // namespace diorama::lint
