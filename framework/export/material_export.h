// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "diorama/material.h"
#include "framework/export/usd_layer.h"

namespace diorama::usd_export {

/// A picture that a layer refers to.
struct TextureFile {
  std::string name;  ///< Below the layer's folder: "textures/export_scene_wood_DIFFUSE.png".
  std::shared_ptr<const Texture> texture;
};

/// Names the pictures of one layer; each texture gets one file.
class TextureNames {
 public:
  /// Files are called "<folder>/<stem>_<thing>_<pass>.png", or ".hdr" when they hold floats.
  TextureNames(std::string folder, std::string stem);
  /// The path to write into the layer.
  AssetPath name(const std::shared_ptr<const Texture>& texture, const std::string& thing,
                 const std::string& pass);
  const std::vector<TextureFile>& files() const { return files_; }

 private:
  std::string folder_;
  std::string stem_;
  std::vector<TextureFile> files_;
  std::map<const Texture*, std::size_t> known_;
  std::map<std::string, int> taken_;
};

/// A Material prim called `name` at `path` with a UsdPreviewSurface network, its shaders named as
/// Blender's exporter does. Transmission becomes low opacity, the nearest thing that this surface
/// model has.
Prim material_prim(const Material& material, const std::string& name, const std::string& path,
                   TextureNames& textures);

/// `text` as a prim name: what is no letter, digit or underscore becomes an underscore.
std::string prim_name(const std::string& text);

}  // namespace diorama::usd_export
