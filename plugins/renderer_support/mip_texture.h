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

  explicit operator bool() const { return texture != nullptr; }
  /// Scaled and biased. `uv_footprint` is in mesh uv units.
  Rgba at(const Vec2f& mesh_uv, float uv_footprint) const;
  float scalar(const Vec2f& mesh_uv, float uv_footprint) const {
    return at(mesh_uv, uv_footprint)[input->channel];
  }
};

inline int MipTexture::wrapped(int i, int size, Wrap wrap) {
  if (unsigned(i) < unsigned(size)) return i;
  switch (wrap) {
    case Wrap::Black:
      return -1;
    case Wrap::Clamp:
      return std::clamp(i, 0, size - 1);
    case Wrap::Mirror: {
      const int k = ((i % (2 * size)) + 2 * size) % (2 * size);
      return k < size ? k : 2 * size - 1 - k;
    }
    case Wrap::Repeat:
      break;
  }
  return i < 0 ? i + size : i - size;  // at most one step outside, see bilinear()
}

inline Rgba MipTexture::texel(int index, int x, int y) const {
  const Level& level = levels_[std::size_t(index)];
  const int channels = source_->channels;
  const std::size_t at =
      (std::size_t(y) * std::size_t(level.width) + std::size_t(x)) * std::size_t(channels);
  if (!source_->bytes.empty()) {
    const std::uint8_t* p = (index == 0 ? source_->bytes.data() : level.bytes.data()) + at;
    const auto& linear = *linear_from_byte_;
    const float red = linear[p[0]];
    if (channels < 3) return {red, red, red, channels == 2 ? float(p[1]) / 255.0f : 1.0f};
    return {red, linear[p[1]], linear[p[2]], channels == 4 ? float(p[3]) / 255.0f : 1.0f};
  }
  const float* p = (index == 0 ? source_->floats.data() : level.floats.data()) + at;
  const bool decode = index == 0 && source_->color_space == ColorSpace::Srgb;
  const auto linear = [&](float v) { return decode ? linear_from_srgb(v) : v; };
  const float red = linear(p[0]);
  if (channels < 3) return {red, red, red, channels == 2 ? p[1] : 1.0f};
  return {red, linear(p[1]), linear(p[2]), channels == 4 ? p[3] : 1.0f};
}

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

[[gnu::noinline]] inline Rgba MipTexture::bilinear(int index, const Vec2f& uv, Wrap wrap_u,
                                                   Wrap wrap_v) const {
  const Level& level = levels_[std::size_t(index)];
  constexpr float kLimit = 1e8f;  // far outside any sane coordinate, inside int
  // Without the library's floor, which is a call on old processors.
  const auto rounded_down = [](float v) { return int(v) - int(v < 0.0f); };
  const auto texels = [&](float v, int size, Wrap wrap) {
    const float limited = std::clamp(v, -kLimit, kLimit);
    const float within = wrap == Wrap::Repeat ? limited - float(rounded_down(limited)) : limited;
    return std::clamp(within * float(size) - 0.5f, -kLimit, kLimit);
  };
  const float x = texels(uv.x(), level.width, wrap_u);
  const float y = texels(1.0f - uv.y(), level.height, wrap_v);
  const int left = rounded_down(x);
  const int above = rounded_down(y);
  const float fx = x - float(left);
  const float fy = y - float(above);
  const int x0 = wrapped(left, level.width, wrap_u);
  const int x1 = wrapped(left + 1, level.width, wrap_u);
  const int y0 = wrapped(above, level.height, wrap_v);
  const int y1 = wrapped(above + 1, level.height, wrap_v);
  const auto get = [&](int u, int v) -> Rgba {
    if (u < 0 || v < 0) return Rgba::Zero();
    return texel(index, u, v);
  };
  const Rgba top = get(x0, y0) * (1.0f - fx) + get(x1, y0) * fx;
  const Rgba bottom = get(x0, y1) * (1.0f - fx) + get(x1, y1) * fx;
  return top * (1.0f - fy) + bottom * fy;
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
  const float scale = std::sqrt(std::abs(map(0, 0) * map(1, 1) - map(0, 1) * map(1, 0)));
  const Rgba value = texture->lookup(uv, uv_footprint * scale, input->wrap_u, input->wrap_v);
  return value * Rgba(input->scale[0], input->scale[1], input->scale[2], input->scale[3]) +
         Rgba(input->bias[0], input->bias[1], input->bias[2], input->bias[3]);
}

}  // namespace diorama
