// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "diorama/material.h"

namespace diorama {

using Rgba = Eigen::Array4f;

/// A texture with its smaller versions, each half as large, averaged in linear light. 8-bit
/// textures stay 8-bit. Immutable; lookups from any thread.
class MipTexture {
 public:
  explicit MipTexture(std::shared_ptr<const Texture> source);

  int width() const { return levels_[0].width; }
  int height() const { return levels_[0].height; }
  int level_count() const { return int(levels_.size()); }

  /// Linear values at texture coordinates, (0, 0) lower left, filtered bilinearly and between
  /// levels. `footprint` is the width of the wanted average as a share of the texture's. Missing
  /// channels: grey is repeated, alpha is 1.
  Rgba lookup(const Vec2f& uv, float footprint, Wrap wrap_u, Wrap wrap_v) const;
  /// One texel of a level, row 0 on top.
  Rgba texel(int level, int x, int y) const;

 private:
  struct Level {
    int width = 0;
    int height = 0;
    std::vector<std::uint8_t> bytes;  ///< Empty on level 0, which reads the source.
    std::vector<float> floats;
  };

  Rgba bilinear(int level, const Vec2f& uv, Wrap wrap_u, Wrap wrap_v) const;
  void add_level();

  std::shared_ptr<const Texture> source_;
  std::array<float, 256> linear_from_byte_;
  std::vector<Level> levels_;
};

/// A texture input of a material, ready for lookups. The source input must outlive it.
struct TextureSlot {
  const TextureInput* input = nullptr;
  const MipTexture* texture = nullptr;

  explicit operator bool() const { return texture != nullptr; }
  /// Scaled and biased. `uv_footprint` is in mesh uv units.
  Rgba at(const Vec2f& mesh_uv, float uv_footprint) const;
  float scalar(const Vec2f& mesh_uv, float uv_footprint) const {
    return at(mesh_uv, uv_footprint)[input->channel];
  }
};

}  // namespace diorama
