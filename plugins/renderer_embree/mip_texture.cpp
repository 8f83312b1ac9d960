// SPDX-License-Identifier: Apache-2.0
#include "mip_texture.h"

#include <algorithm>

#include "diorama/error.h"
#include "diorama/image.h"
#include "srgb_bytes.h"

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

const SrgbBytes& srgb_bytes() {
  static const SrgbBytes bytes;
  return bytes;
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
  const std::size_t values = std::size_t(level.width) * std::size_t(level.height * channels);
  source_->bytes.empty() ? level.floats.reserve(values) : level.bytes.reserve(values);
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
        level.bytes.push_back(is_encoded ? srgb_bytes()(value)
                                         : std::uint8_t(value * 255.0f + 0.5f));
      }
    }
  }
  levels_.push_back(std::move(level));
}

}  // namespace diorama
