// SPDX-License-Identifier: Apache-2.0
#include "loader_urdf/urdf_loader.h"

#include <algorithm>

#include "diorama/error.h"
#include "loader_urdf/model_file.h"
#include "loader_urdf/model_translator.h"

namespace diorama::loader_urdf {

void UrdfLoader::Params::visit(ParamVisitor& v) {
  v.param("packages", packages,
          {"Folders of packages, or with packages in them, that package:// is looked up in, before "
           "the folders above the model."});
  v.param("missing_assets_are_errors", missing_assets_are_errors,
          {"Whether a missing mesh or texture ends the job instead of being warned about."});
}

std::vector<std::filesystem::path> UrdfLoader::files(std::string_view asset) const {
  const std::string name(asset);
  const auto model = read_model(name);
  const MeshFinder finder(name, params_.packages, host_);
  std::vector<std::filesystem::path> files{name};
  const auto add = [&](const std::string& file) {
    if (file.empty()) return;
    const auto found = finder.find(file);
    if (found && std::find(files.begin(), files.end(), *found) == files.end()) {
      files.push_back(*found);
    }
  };
  const auto add_geometry = [&](const urdf::GeometrySharedPtr& geometry) {
    if (geometry && geometry->type == urdf::Geometry::MESH) {
      add(static_cast<const urdf::Mesh&>(*geometry).filename);
    }
  };
  for (const auto& [link_name, link] : model->links_) {
    for (const auto& visual : link->visual_array) {
      if (!visual) continue;
      add_geometry(visual->geometry);
      if (visual->material) add(visual->material->texture_filename);
    }
    for (const auto& collision : link->collision_array) {
      if (collision) add_geometry(collision->geometry);
    }
  }
  return files;
}

void UrdfLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  const std::string name(asset);
  std::string complaint;
  const auto model = read_model(name, &complaint);
  if (!complaint.empty()) {
    host_.log(LogLevel::Warning, name + ": a part of it cannot be read: " + complaint);
  }
  const MeshFinder finder(name, params_.packages, host_);
  ModelTranslator translator(*model, finder, host_, scene);
  try {
    translator.translate(root);
  } catch (const Error& error) {
    const std::string text = error.what();
    if (text.starts_with(name)) throw;
    throw Error(ErrorKind::Asset, name + ": " + text);
  }
  if (params_.missing_assets_are_errors && !translator.missing().empty()) {
    throw Error(ErrorKind::Asset, name + ": " + translator.missing().front());
  }
  for (const std::string& text : translator.missing()) {
    host_.log(LogLevel::Warning, name + ": " + text);
  }
  for (const std::string& text : translator.warnings()) {
    host_.log(LogLevel::Warning, name + ": " + text);
  }
}

}  // namespace diorama::loader_urdf
