// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include "diorama/math.h"

namespace diorama {

using Rgba8 = std::array<std::uint8_t, 4>;

/// Pixels row by row from the top left, without padding.
template <class Pixel>
class Image {
 public:
  using PixelType = Pixel;
  Image() = default;
  Image(int width, int height, const Pixel& fill)
      : width_(width), height_(height), pixels_(std::size_t(width) * std::size_t(height), fill) {}

  int width() const { return width_; }
  int height() const { return height_; }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  Pixel& at(int x, int y) { return pixels_[offset(x, y)]; }
  const Pixel& at(int x, int y) const { return pixels_[offset(x, y)]; }
  std::span<Pixel> row(int y) { return {pixels_.data() + offset(0, y), std::size_t(width_)}; }
  std::span<const Pixel> row(int y) const {
    return {pixels_.data() + offset(0, y), std::size_t(width_)};
  }
  std::span<Pixel> pixels() { return pixels_; }
  std::span<const Pixel> pixels() const { return pixels_; }

  friend bool operator==(const Image&, const Image&) = default;

 private:
  std::size_t offset(int x, int y) const {
    assert(x >= 0 && x < width_ && y >= 0 && y < height_);
    return std::size_t(y) * std::size_t(width_) + std::size_t(x);
  }
  int width_ = 0;
  int height_ = 0;
  std::vector<Pixel> pixels_;
};

using AnyImage =
    std::variant<Image<Rgba8>, Image<float>, Image<Vec2f>, Image<Vec3f>, Image<std::uint32_t>>;

/// Half open: x_max and y_max are one past the last pixel. Empty when x_min >= x_max. Coordinates
/// may lie outside an image where the use says so.
struct PixelBox {
  int x_min = 0;
  int y_min = 0;
  int x_max = 0;
  int y_max = 0;

  int width() const { return x_max - x_min; }
  int height() const { return y_max - y_min; }
  bool is_empty() const { return x_min >= x_max || y_min >= y_max; }
  /// The part inside an image of this size.
  DIORAMA_SDK_API PixelBox clipped(int image_width, int image_height) const;
  friend bool operator==(const PixelBox&, const PixelBox&) = default;
};

/// sRGB transfer function (IEC 61966-2-1), for values in [0, 1].
DIORAMA_SDK_API float srgb_from_linear(float linear);
DIORAMA_SDK_API float linear_from_srgb(float srgb);

}  // namespace diorama
