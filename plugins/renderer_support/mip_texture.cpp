// SPDX-License-Identifier: Apache-2.0
#include "mip_texture.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <type_traits>

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

/// As Rgba, but made in a register: compilers write an Eigen vector's numbers to memory one by one,
/// and to read them at once then waits for all.
using Values = float __attribute__((vector_size(16)));

Rgba rgba(const Values& values) {
  Rgba result;
  std::memcpy(result.data(), &values, sizeof(values));
  return result;
}

Values values_of(const Rgba& rgba) { return Values{rgba[0], rgba[1], rgba[2], rgba[3]}; }

Values linear_values(const std::uint8_t* texel, int channels,
                     const std::array<float, 256>& linear) {
  const float red = linear[texel[0]];
  if (channels < 3) return Values{red, red, red, channels == 2 ? float(texel[1]) / 255.0f : 1.0f};
  return Values{red, linear[texel[1]], linear[texel[2]],
                channels == 4 ? float(texel[3]) / 255.0f : 1.0f};
}

Values linear_values(const float* texel, int channels, bool is_srgb) {
  const auto linear = [&](float v) { return is_srgb ? linear_from_srgb(v) : v; };
  const float red = linear(texel[0]);
  if (channels < 3) return Values{red, red, red, channels == 2 ? texel[1] : 1.0f};
  return Values{red, linear(texel[1]), linear(texel[2]), channels == 4 ? texel[3] : 1.0f};
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

int MipTexture::wrapped(int i, int size, Wrap wrap) {
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

Rgba MipTexture::texel(int index, int x, int y) const {
  const Level& level = levels_[std::size_t(index)];
  const int channels = source_->channels;
  const std::size_t at =
      (std::size_t(y) * std::size_t(level.width) + std::size_t(x)) * std::size_t(channels);
  if (source_->bytes.empty()) {
    return rgba(linear_values(floats_of(index) + at, channels, has_srgb_floats(index)));
  }
  return rgba(linear_values(bytes(index).data() + at, channels, *linear_from_byte_));
}

Rgba MipTexture::bilinear(int index, const Vec2f& uv, Wrap wrap_u, Wrap wrap_v) const {
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
  const auto blend = [&](const auto& get) {
    const auto top = get(x0, y0) * (1.0f - fx) + get(x1, y0) * fx;
    const auto bottom = get(x0, y1) * (1.0f - fx) + get(x1, y1) * fx;
    return Values(top * (1.0f - fy) + bottom * fy);
  };
  if (std::min({x0, x1, y0, y1}) < 0) {
    return rgba(blend(
        [&](int u, int v) { return u < 0 || v < 0 ? Values{} : values_of(texel(index, u, v)); }));
  }
  // Nothing is asked four times: with borders looked for here, whole pictures took 1 % longer.
  const auto blend_from = [&](const auto* values, auto channels, const auto& linear) {
    const auto width = std::size_t(level.width);
    return rgba(blend([&](int u, int v) {
      const std::size_t at = std::size_t(v) * width + std::size_t(u);
      return linear_values(values + at * channels, channels, linear);
    }));
  };
  const auto blend_channels = [&](auto channels) {
    if (source_->bytes.empty()) {
      return blend_from(floats_of(index), channels, has_srgb_floats(index));
    }
    return blend_from(bytes(index).data(), channels, *linear_from_byte_);
  };
  switch (source_->channels) {
    case 1:
      return blend_channels(std::integral_constant<int, 1>());
    case 2:
      return blend_channels(std::integral_constant<int, 2>());
    case 3:
      return blend_channels(std::integral_constant<int, 3>());
    default:
      return blend_channels(std::integral_constant<int, 4>());
  }
}

}  // namespace diorama
