// SPDX-License-Identifier: Apache-2.0
#include "mip_texture.h"

#include <algorithm>
#include <cmath>

#include "diorama/error.h"
#include "diorama/image.h"

namespace diorama {
namespace {

void check(const Texture& texture) {
  const bool has_size =
      texture.width > 0 && texture.height > 0 && texture.channels >= 1 && texture.channels <= 4;
  const std::size_t count = has_size ? std::size_t(texture.width) * std::size_t(texture.height) *
                                           std::size_t(texture.channels)
                                     : 0;
  const bool is_whole =
      has_size && (texture.bytes.size() == count) != (texture.floats.size() == count);
  if (is_whole) return;
  throw Error(ErrorKind::Asset, texture.name + ": texture of " + std::to_string(texture.width) +
                                    " x " + std::to_string(texture.height) + " pixels and " +
                                    std::to_string(texture.channels) + " channels holds " +
                                    std::to_string(texture.bytes.size()) + " bytes and " +
                                    std::to_string(texture.floats.size()) +
                                    " floats; one of them must fit the size");
}

/// -1: outside a texture that is black outside.
int wrapped(int i, int size, Wrap wrap) {
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
  return ((i % size) + size) % size;
}

}  // namespace

MipTexture::MipTexture(std::shared_ptr<const Texture> source) : source_(std::move(source)) {
  check(*source_);
  const bool is_srgb = source_->color_space == ColorSpace::Srgb;
  for (std::size_t i = 0; i < 256; ++i) {
    const float value = float(i) / 255.0f;
    linear_from_byte_[i] = is_srgb ? linear_from_srgb(value) : value;
  }
  levels_.push_back({source_->width, source_->height, {}, {}});
  while (levels_.back().width > 1 || levels_.back().height > 1) add_level();
}

void MipTexture::add_level() {
  const int from = level_count() - 1;
  const int old_width = levels_.back().width;
  const int old_height = levels_.back().height;
  Level level{std::max(1, old_width / 2), std::max(1, old_height / 2), {}, {}};
  const int channels = source_->channels;
  const bool is_srgb = source_->color_space == ColorSpace::Srgb;
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) {
      // Odd sizes: the last pair grows to three so that no texel is lost.
      const int x_end = x + 1 == level.width ? old_width : 2 * x + 2;
      const int y_end = y + 1 == level.height ? old_height : 2 * y + 2;
      Rgba sum = Rgba::Zero();
      for (int v = 2 * y; v < y_end; ++v) {
        for (int u = 2 * x; u < x_end; ++u) sum += texel(from, u, v);
      }
      const Rgba mean = sum / float(std::max(1, (x_end - 2 * x) * (y_end - 2 * y)));
      for (int c = 0; c < channels; ++c) {
        // Two channels mean grey and alpha.
        const float value = channels == 2 && c == 1 ? mean[3] : mean[c];
        if (source_->bytes.empty()) {
          level.floats.push_back(value);
          continue;
        }
        const bool is_encoded = is_srgb && c < 3 && !(channels == 2 && c == 1);
        const float stored = is_encoded ? srgb_from_linear(std::clamp(value, 0.0f, 1.0f)) : value;
        level.bytes.push_back(std::uint8_t(stored * 255.0f + 0.5f));
      }
    }
  }
  levels_.push_back(std::move(level));
}

Rgba MipTexture::texel(int index, int x, int y) const {
  const Level& level = levels_[std::size_t(index)];
  const int channels = source_->channels;
  const std::size_t at =
      (std::size_t(y) * std::size_t(level.width) + std::size_t(x)) * std::size_t(channels);
  Rgba value(0.0f, 0.0f, 0.0f, 1.0f);
  if (!source_->bytes.empty()) {
    const std::uint8_t* p = (index == 0 ? source_->bytes.data() : level.bytes.data()) + at;
    if (channels < 3) {
      value.head<3>().setConstant(linear_from_byte_[p[0]]);
      if (channels == 2) value[3] = float(p[1]) / 255.0f;
      return value;
    }
    for (int c = 0; c < 3; ++c) value[c] = linear_from_byte_[p[c]];
    if (channels == 4) value[3] = float(p[3]) / 255.0f;
    return value;
  }
  const float* p = (index == 0 ? source_->floats.data() : level.floats.data()) + at;
  const bool decode = source_->color_space == ColorSpace::Srgb;
  const auto linear = [&](float v) { return decode && index == 0 ? linear_from_srgb(v) : v; };
  if (channels < 3) {
    value.head<3>().setConstant(linear(p[0]));
    if (channels == 2) value[3] = p[1];
    return value;
  }
  for (int c = 0; c < 3; ++c) value[c] = linear(p[c]);
  if (channels == 4) value[3] = p[3];
  return value;
}

Rgba MipTexture::bilinear(int index, const Vec2f& uv, Wrap wrap_u, Wrap wrap_v) const {
  const Level& level = levels_[std::size_t(index)];
  constexpr float kLimit = 1e8f;  // far outside any sane coordinate, inside int
  const float x = std::clamp(uv.x() * float(level.width) - 0.5f, -kLimit, kLimit);
  const float y = std::clamp((1.0f - uv.y()) * float(level.height) - 0.5f, -kLimit, kLimit);
  const float x_floor = std::floor(x);
  const float y_floor = std::floor(y);
  const float fx = x - x_floor;
  const float fy = y - y_floor;
  const int x0 = wrapped(int(x_floor), level.width, wrap_u);
  const int x1 = wrapped(int(x_floor) + 1, level.width, wrap_u);
  const int y0 = wrapped(int(y_floor), level.height, wrap_v);
  const int y1 = wrapped(int(y_floor) + 1, level.height, wrap_v);
  const auto get = [&](int u, int v) -> Rgba {
    if (u < 0 || v < 0) return Rgba::Zero();
    return texel(index, u, v);
  };
  const Rgba top = get(x0, y0) * (1.0f - fx) + get(x1, y0) * fx;
  const Rgba bottom = get(x0, y1) * (1.0f - fx) + get(x1, y1) * fx;
  return top * (1.0f - fy) + bottom * fy;
}

Rgba MipTexture::lookup(const Vec2f& uv, float footprint, Wrap wrap_u, Wrap wrap_v) const {
  const float texels = footprint * float(std::max(width(), height()));
  if (!(texels > 1.0f)) return bilinear(0, uv, wrap_u, wrap_v);
  const float level = std::min(std::log2(texels), float(level_count() - 1));
  const int low = int(level);
  const float rest = level - float(low);
  const Rgba fine = bilinear(low, uv, wrap_u, wrap_v);
  if (rest == 0.0f) return fine;
  return fine * (1.0f - rest) + bilinear(low + 1, uv, wrap_u, wrap_v) * rest;
}

Rgba TextureSlot::at(const Vec2f& mesh_uv, float uv_footprint) const {
  const auto& map = input->uv_from_mesh_uv;
  const Vec2f uv = map.leftCols<2>() * mesh_uv + map.col(2);
  const float scale = std::sqrt(std::abs(map(0, 0) * map(1, 1) - map(0, 1) * map(1, 0)));
  const Rgba value = texture->lookup(uv, uv_footprint * scale, input->wrap_u, input->wrap_v);
  return value * Rgba(input->scale[0], input->scale[1], input->scale[2], input->scale[3]) +
         Rgba(input->bias[0], input->bias[1], input->bias[2], input->bias[3]);
}

}  // namespace diorama
