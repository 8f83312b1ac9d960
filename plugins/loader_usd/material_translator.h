// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"
#include "loader_usd/texture_library.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

struct TranslatedMaterial {
  std::shared_ptr<const Material> material;
  std::vector<std::string> uv_names;  ///< Primvars that its textures are laid out by.
};

/// Makes materials out of UsdPreviewSurface networks, and out of MDL shaders by the names of their
/// common inputs. Instances of one material share it.
class MaterialTranslator {
 public:
  MaterialTranslator(usd::Stage& stage, Host& host)
      : stage_(stage), host_(host), textures_(stage, host) {}

  /// A null material for an empty path or one without a surface that is understood.
  const TranslatedMaterial& translate(const std::string& path);

  TextureLibrary& textures() { return textures_; }

 private:
  /// Where an input gets its value from: an output of a shader, or a value.
  struct Source {
    const usd::Prim* prim = nullptr;
    std::string attribute;  ///< Of a value.
    std::string output;     ///< Of a shader: `rgb`; empty for a value.
  };

  Source follow(const usd::Prim& prim, const std::string& attribute) const;
  const usd::Prim* surface(const usd::Prim& material, std::string_view output) const;
  usd::FoundValue input(const usd::Prim& shader, const std::string& name) const;
  float number(const usd::Prim& shader, const std::string& name, float fallback) const;
  bool boolean(const usd::Prim& shader, const std::string& name, bool fallback) const;
  Vec3f color(const usd::Prim& shader, const std::string& name, const Vec3f& fallback) const;

  TextureInput texture(const usd::Prim& shader, const std::string& name, bool is_data,
                       TranslatedMaterial& result);
  void read_layout(const usd::Prim& texture, TextureInput& input, TranslatedMaterial& result);
  void translate_preview_surface(const usd::Prim& shader, Material& material,
                                 TranslatedMaterial& result);
  void translate_mdl(const usd::Prim& shader, Material& material);
  TextureInput mdl_texture(const usd::Prim& shader, std::initializer_list<const char*> names,
                           TextureSpace space);
  std::string mdl_name(const usd::Prim& shader) const;

  usd::Stage& stage_;
  Host& host_;
  TextureLibrary textures_;
  std::map<std::string, TranslatedMaterial> by_path_;
  std::map<std::vector<std::pair<const void*, std::string>>, TranslatedMaterial> by_sites_;
  std::set<std::string> noticed_modules_;
};

}  // namespace diorama::loader_usd
