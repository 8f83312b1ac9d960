// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "huge_pages.h"
#include "lanes.h"

namespace diorama {

/// Several numbers per pixel, each in a layer of its own. The layers of one picture row lie next to
/// each other, and each starts and ends with a margin, so that groups of kLanes pixels can be read
/// as far beside the picture as the margin is wide.
template <int kLayers>
class PixelLayers {
 public:
  using Pixel = std::array<float, kLayers>;

  PixelLayers() = default;
  /// Without values as yet.
  PixelLayers(int width, int height, int margin)
      : width_(width),
        margin_(std::size_t(margin)),
        stride_(std::size_t((width + kLanes - 1) / kLanes * kLanes) + 2 * margin_),
        values_(stride_ * kLayers * std::size_t(height)) {}

  /// Gives the margins of a row these values; they reach as far as the last whole group.
  void fill_margins(int y, const Pixel& outside) {
    const Row own = row(y);
    for (int layer = 0; layer < kLayers; ++layer) {
      const float value = outside[std::size_t(layer)];
      float* begin = own.at(layer, 0);
      std::fill_n(begin - margin_, margin_, value);
      std::fill(begin + width_, begin - margin_ + stride_, value);
    }
  }

  struct Row {
    float* first;  ///< Pixel 0 of layer 0.
    std::size_t stride;
    float* at(int layer, int x) const {
      return first + std::ptrdiff_t(std::size_t(layer) * stride) + x;
    }
    Lanes lanes(int layer, int x) const { return load_lanes(at(layer, x)); }
    /// Of three layers in a row.
    Lanes3 lanes3(int layer, int x) const {
      return {lanes(layer, x), lanes(layer + 1, x), lanes(layer + 2, x)};
    }
    /// Calls pixels from x on into the cache. Compilers leave out calls that do nothing else.
    [[gnu::always_inline]] void fetch(int x) const {
      constexpr int kCacheLine = 16;
      if (x % kCacheLine != 0) return;
      for (int layer = 0; layer < kLayers; ++layer) __builtin_prefetch(at(layer, x));
    }
  };
  Row row(int y) const {
    return {values_.data() + std::size_t(y) * stride_ * kLayers + margin_, stride_};
  }

 private:
  int width_ = 0;
  std::size_t margin_ = 0;
  std::size_t stride_ = 0;
  HugePages<float> values_;
};

}  // namespace diorama
