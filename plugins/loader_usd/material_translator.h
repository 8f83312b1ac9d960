// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"
#include "loader_usd/material_draft.h"
#include "loader_usd/shader_network.h"
#include "loader_usd/texture_library.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

struct TranslatedMaterial {
  std::shared_ptr<const Material> material;
  std::vector<std::string> uv_names;  ///< Primvars that its textures are laid out by.
  /// Set where the base colour is the displayColor of the mesh: what stands in for that.
  std::optional<Vec3f> display_color_fallback;
  bool reads_display_color() const { return !material || display_color_fallback; }
};

/// Makes materials out of UsdPreviewSurface networks, MaterialX surfaces and, by the names of their
/// common inputs, MDL shaders. Instances of one material share it.
class MaterialTranslator {
 public:
  MaterialTranslator(usd::Stage& stage, Host& host)
      : stage_(stage), host_(host), network_(stage), textures_(stage, host) {}

  /// A null material for an empty path or one without a surface that is understood. Textures are
  /// missing until read_textures().
  const TranslatedMaterial& translate(const std::string& path);

  /// Reads the textures of all materials that were translated, several at a time, and reports those
  /// that are missing.
  void read_textures();

  TextureLibrary& textures() { return textures_; }

 private:
  TranslatedMaterial translate(const usd::Prim& material);
  void notice_module(const usd::Prim& shader);
  void notice_displacement(const usd::Prim& surface);

  usd::Stage& stage_;
  Host& host_;
  ShaderNetwork network_;
  TextureLibrary textures_;
  std::deque<MaterialDraft> drafts_;
  std::map<std::string, TranslatedMaterial> by_path_;
  std::map<std::vector<std::pair<const void*, std::string>>, TranslatedMaterial> by_sites_;
  std::set<std::string> noticed_modules_;
  bool has_noticed_displacement_ = false;
};

}  // namespace diorama::loader_usd
