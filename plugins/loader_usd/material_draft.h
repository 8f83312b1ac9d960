// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diorama/material.h"
#include "loader_usd/shader_network.h"
#include "loader_usd/texture_library.h"

namespace diorama::loader_usd {

/// A material in the making: its textures are known, but not read yet, so that those of all
/// materials can be read together.
class MaterialDraft {
 public:
  MaterialDraft(const ShaderNetwork& network, TextureLibrary& textures)
      : network_(network), textures_(textures) {}

  Material& material() { return *material_; }
  std::shared_ptr<const Material> shared() const { return material_; }
  const ShaderNetwork& network() const { return network_; }

  /// Primvars that its textures are laid out by.
  std::vector<std::string> uv_names;
  /// Set where the base colour is the displayColor of the mesh: what stands in for that.
  std::optional<Vec3f> display_color_fallback;

  /// Plans a texture; false when there is no such picture. How it lies on the mesh and which
  /// channel counts is set on the input itself, before or after.
  bool connect(TextureInput Material::*input, const usd::FoundValue& asset, TextureSpace space);
  bool is_textured(TextureInput Material::*input) const;

  /// Fills in the textures. A colour whose picture turns out to be broken becomes grey.
  void finish();

 private:
  struct Plan {
    TextureInput Material::*input;
    usd::FoundValue asset;
    TextureSpace space;
  };

  const ShaderNetwork& network_;
  TextureLibrary& textures_;
  std::shared_ptr<Material> material_ = std::make_shared<Material>();
  std::vector<Plan> plans_;
};

/// A 2 x 3 map of texture coordinates that first scales, then turns, then moves.
Eigen::Matrix<float, 2, 3> uv_map(const Vec2f& scale, float degrees, const Vec2f& offset);

/// First `inner`, then `outer`.
Eigen::Matrix<float, 2, 3> compose(const Eigen::Matrix<float, 2, 3>& outer,
                                   const Eigen::Matrix<float, 2, 3>& inner);

/// Eight-bit normal maps hold 0 to 1 for -1 to 1.
void unpack_normals(TextureInput& input, float strength = 1.0f);

}  // namespace diorama::loader_usd
