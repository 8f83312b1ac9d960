// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "diorama/image.h"
#include "diorama/material.h"

namespace diorama {

using Rgba = Eigen::Array4f;

/// A texture with its smaller versions, each half as large, averaged in linear light. 8-bit
/// textures stay 8-bit. Immutable; lookups from any thread. The source must outlive all lookups; it
/// is not owned, so that a cache of these does not keep alive what it serves.
class MipTexture {
 public:
  /// The first version that is no wider than `wide_enough` is the last.
  explicit MipTexture(const Texture& source, int wide_enough = 0);

  int width() const { return levels_[0].width; }
  int height() const { return levels_[0].height; }
  int level_count() const { return int(levels_.size()); }
  int level_width(int level) const { return levels_[std::size_t(level)].width; }
  int level_height(int level) const { return levels_[std::size_t(level)].height; }
  /// Of 8-bit textures: a level's values as they are stored, interleaved; else none.
  std::span<const std::uint8_t> bytes(int level) const {
    return level == 0 ? source_->bytes : levels_[std::size_t(level)].bytes;
  }
  int channels() const { return source_->channels; }
  bool is_srgb() const { return source_->color_space == ColorSpace::Srgb; }
  /// No other texture of the process has or had it.
  std::uint64_t number() const { return number_; }

  /// Linear values at texture coordinates, (0, 0) lower left, filtered bilinearly and between
  /// levels. `footprint` is the width of the wanted average as a share of the texture's. Missing
  /// channels: grey is repeated, alpha is 1.
  Rgba lookup(const Vec2f& uv, float footprint, Wrap wrap_u, Wrap wrap_v) const;
  /// Starts to fetch the texels around uv in [0, 1) of the finest level from memory.
  void prefetch(const Vec2f& uv) const;
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
  const float* floats_of(int level) const {
    return level == 0 ? source_->floats.data() : levels_[std::size_t(level)].floats.data();
  }
  /// Smaller versions are linear.
  bool has_srgb_floats(int level) const { return level == 0 && is_srgb(); }
  /// -1: outside a texture that is black outside.
  static int wrapped(int i, int size, Wrap wrap);
  void add_level();

  const Texture* source_;
  std::uint64_t number_;
  /// All textures share two of them, which stay in a processor's cache.
  const std::array<float, 256>* linear_from_byte_;
  std::vector<Level> levels_;
};

/// A texture input of a material, ready for lookups. The source input must outlive it.
struct TextureSlot {
  const TextureInput* input = nullptr;
  const MipTexture* texture = nullptr;
  float uv_per_mesh_uv = input ? scale_of(input->uv_from_mesh_uv) : 1.0f;  ///< Of lengths.

  explicit operator bool() const { return texture != nullptr; }
  /// Scaled and biased. `uv_footprint` is in mesh uv units.
  Rgba at(const Vec2f& mesh_uv, float uv_footprint) const;
  float scalar(const Vec2f& mesh_uv, float uv_footprint) const {
    return at(mesh_uv, uv_footprint)[input->channel];
  }

 private:
  static float scale_of(const Eigen::Matrix<float, 2, 3>& map) {
    return std::sqrt(std::abs(map(0, 0) * map(1, 1) - map(0, 1) * map(1, 0)));
  }
};

inline void MipTexture::prefetch(const Vec2f& uv) const {
  const int x = std::clamp(int(uv.x() * float(width()) - 0.5f), 0, width() - 1);
  const int y = std::clamp(int((1.0f - uv.y()) * float(height()) - 0.5f), 0, height() - 1);
  const std::size_t row = std::size_t(width()) * std::size_t(source_->channels);
  const std::size_t at = std::size_t(y) * row + std::size_t(x) * std::size_t(source_->channels);
  const auto fetch = [&](const auto& values) {
    if (values.empty()) return;
    __builtin_prefetch(&values[at]);
    __builtin_prefetch(&values[std::min(at + row, values.size() - 1)]);
  };
  fetch(source_->bytes);
  fetch(source_->floats);
}

inline Rgba MipTexture::lookup(const Vec2f& uv, float footprint, Wrap wrap_u, Wrap wrap_v) const {
  const float texels = footprint * float(std::max(width(), height()));
  if (!(texels > 1.0f)) return bilinear(0, uv, wrap_u, wrap_v);
  const float level = std::min(std::log2(texels), float(level_count() - 1));
  const int low = int(level);
  const float rest = level - float(low);
  const Rgba fine = bilinear(low, uv, wrap_u, wrap_v);
  if (rest == 0.0f) return fine;
  return fine * (1.0f - rest) + bilinear(low + 1, uv, wrap_u, wrap_v) * rest;
}

inline Rgba TextureSlot::at(const Vec2f& mesh_uv, float uv_footprint) const {
  const auto& map = input->uv_from_mesh_uv;
  const Vec2f uv = map.leftCols<2>() * mesh_uv + map.col(2);
  const float footprint = uv_footprint * uv_per_mesh_uv;
  const Rgba value = texture->lookup(uv, footprint, input->wrap_u, input->wrap_v);
  // Read at once: Eigen writes four numbers to memory one by one, and reading them waits for that.
  const auto all = [](const std::array<float, 4>& v) { return Eigen::Map<const Rgba>(v.data()); };
  return value * all(input->scale) + all(input->bias);
}

}  // namespace diorama
