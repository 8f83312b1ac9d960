// SPDX-License-Identifier: Apache-2.0
#include "mip_texture.h"

#include <algorithm>
#include <atomic>

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

std::uint64_t next_number() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

const SrgbBytes& srgb_bytes() {
  static const SrgbBytes bytes;
  return bytes;
}

struct Size {
  int width = 0;
  int height = 0;
};

Size half(const Size& size) { return {std::max(1, size.width / 2), std::max(1, size.height / 2)}; }

/// Each value the mean of two by two: of decode(value, channel), then encoded likewise.
template <class T, class Decode, class Encode>
std::vector<T> halved(const std::vector<T>& from, const Size& size, int channels,
                      const Decode& decode, const Encode& encode) {
  const Size to = half(size);
  const auto step = std::size_t(channels);
  const std::size_t row = std::size_t(size.width) * step;
  std::vector<T> values(std::size_t(to.width) * std::size_t(to.height) * step);
  T* value = values.data();
  const auto add_block = [&](const T* first, int rows, int columns) {
    for (int c = 0; c < channels; ++c) {
      float sum = 0.0f;
      for (int v = 0; v < rows; ++v) {
        const T* texel = first + std::size_t(v) * row + c;
        for (int u = 0; u < columns; ++u, texel += step) sum += decode(*texel, c);
      }
      *value++ = encode(sum / float(rows * columns), c);
    }
  };
  for (int y = 0; y < to.height; ++y) {
    // Odd sizes: the last pair grows to three so that no texel is lost.
    const int rows = y + 1 == to.height ? size.height - 2 * y : 2;
    const T* first = &from[2 * std::size_t(y) * row];
    for (int x = 0; x < to.width; ++x, first += 2 * step) {
      const int columns = x + 1 == to.width ? size.width - 2 * x : 2;
      // Known sizes make short work of nearly all blocks.
      rows == 2 && columns == 2 ? add_block(first, 2, 2) : add_block(first, rows, columns);
    }
  }
  return values;
}

}  // namespace

MipTexture::MipTexture(const Texture& source, int wide_enough)
    : source_(&source), number_(next_number()) {
  check(*source_);
  linear_from_byte_ = &linear_from_byte(is_srgb());
  levels_.push_back({source_->width, source_->height, {}, {}});
  while (levels_.back().width > wide_enough &&
         (levels_.back().width > 1 || levels_.back().height > 1)) {
    add_level();
  }
}

void MipTexture::add_level() {
  const bool is_first = levels_.size() == 1;
  const Level& old = levels_.back();
  const Size size{old.width, old.height};
  Level level{half(size).width, half(size).height, {}, {}};
  const int channels = source_->channels;
  const bool is_srgb = source_->color_space == ColorSpace::Srgb;
  // Two channels mean grey and alpha.
  const int alpha = channels == 2 ? 1 : 3;
  if (source_->bytes.empty()) {
    const bool decodes = is_first && is_srgb;
    level.floats = halved(
        is_first ? source_->floats : old.floats, size, channels,
        [&](float value, int c) { return decodes && c != alpha ? linear_from_srgb(value) : value; },
        [](float mean, int) { return mean; });
  } else {
    const SrgbBytes& encoded = srgb_bytes();
    const auto& linear = *linear_from_byte_;
    level.bytes = halved(
        is_first ? source_->bytes : old.bytes, size, channels,
        [&](std::uint8_t byte, int c) { return c == alpha ? float(byte) / 255.0f : linear[byte]; },
        [&](float mean, int c) {
          return is_srgb && c != alpha ? encoded(mean) : std::uint8_t(mean * 255.0f + 0.5f);
        });
  }
  levels_.push_back(std::move(level));
}

}  // namespace diorama
