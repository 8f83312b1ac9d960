// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"

namespace diorama::loader_urdf {

/// A model as the library reads it. Throws Error(Asset) that begins with the file. `complaint`:
/// what the library says of the first thing that it left out; empty: nothing.
urdf::ModelInterfaceSharedPtr read_model(const std::string& file, std::string* complaint = nullptr);

/// Finds meshes and textures: paths beside the model, file://, and package:// (model:// likewise)
/// in folders of that name: `packages`, those above the model and those beside these. Nothing when
/// there is no such file.
class MeshFinder {
 public:
  MeshFinder(const std::string& model_file, const std::vector<std::string>& packages,
             const Host& host);
  std::optional<std::filesystem::path> find(const std::string& name) const;

 private:
  std::filesystem::path folder_;
  std::vector<std::filesystem::path> packages_;
};

}  // namespace diorama::loader_urdf
