// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "diorama/material.h"
#include "loader_assimp/scene_file.h"
#include "loader_assimp/texture_library.h"

namespace diorama::loader_assimp {

/// Which of a mesh's sets of texture coordinates a material uses: that of its base colour.
unsigned uv_set_of(const SceneFile& file, unsigned material);
bool is_two_sided(const SceneFile& file, unsigned material);

/// Makes materials: metallic and rough ones (glTF, newer FBX and MTL) as they are, others by the
/// looks of Phong's. Each is translated once.
class MaterialTranslator {
 public:
  MaterialTranslator(const SceneFile& file, Host& host) : file_(file), textures_(file, host) {}

  /// Reads the textures of these materials, several at a time.
  void read_textures(const std::set<unsigned>& materials);

  std::shared_ptr<const Material> translate(unsigned index);

  /// One line per missing texture.
  std::vector<std::string> missing() const { return textures_.missing(); }

 private:
  TextureInput texture(const aiMaterial& source, std::initializer_list<aiTextureType> types,
                       ColorSpace space);
  void translate_base_color(const aiMaterial& source, Material& material);
  void translate_metal(const aiMaterial& source, Material& material);
  void translate_specular(const aiMaterial& source, Material& material) const;
  void translate_normals(const aiMaterial& source, Material& material);
  void translate_emission(const aiMaterial& source, Material& material);
  void translate_opacity(const aiMaterial& source, Material& material);
  void translate_glass(const aiMaterial& source, Material& material) const;
  bool is_gltf() const { return file_.format() == Format::Gltf; }

  const SceneFile& file_;
  TextureLibrary textures_;
  std::map<unsigned, std::shared_ptr<const Material>> materials_;
};

}  // namespace diorama::loader_assimp
