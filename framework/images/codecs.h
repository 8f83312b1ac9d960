// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "diorama/host.h"
#include "diorama/material.h"
#include "framework/images/image_codecs.h"

/// One reader and one writer per format; image_codecs.h chooses among them. Readers throw
/// Error(Asset) beginning with `name`. Writers get views that were checked.
namespace diorama::images {

inline constexpr std::uint32_t kMaxSide = 16384;

struct Source {
  std::span<const std::byte> bytes;
  std::string_view name;
  std::uint64_t budget = kPictureBudget;  ///< Bytes of memory that decoding may take.

  [[noreturn]] void refuse(const std::string& reason) const {
    throw Error(ErrorKind::Asset, std::string(name) + ": " + reason);
  }
  /// Refuses sizes that are 0 or too large, before memory is taken.
  void check_size(std::uint64_t width, std::uint64_t height) const {
    if (width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide) return;
    refuse("the image has " + std::to_string(width) + " x " + std::to_string(height) +
           " pixels; 1 to " + std::to_string(kMaxSide) + " a side are read");
  }
  /// Refuses what takes more memory than the budget, before it is taken. `needed` counts the pixels
  /// as they are handed on and all that decoding needs beside them.
  void check_budget(std::uint64_t width, std::uint64_t height, std::uint64_t needed) const {
    if (needed <= budget) return;
    const auto mib = [](std::uint64_t count) { return std::to_string((count + 0xFFFFF) >> 20); };
    refuse("decoding its " + std::to_string(width) + " x " + std::to_string(height) +
           " pixels takes " + mib(needed) + " MiB, the budget is " + mib(budget) +
           " MiB; make the picture smaller or raise --picture-mib");
  }
};

/// Rows of pixels from the first to the last. Memory that nothing was written to costs nothing, so
/// a file that ends early costs what it holds, whatever size it claims.
template <class T>
class GrowingRows {
 public:
  GrowingRows(std::size_t row_size, std::size_t rows) : row_size_(row_size) {
    values_.reserve(row_size * rows);
  }
  /// `count` rows of zeros more; returns their first value. Earlier rows stay where they are.
  T* add(std::size_t count = 1) {
    const std::size_t before = values_.size();
    values_.resize(before + row_size_ * count);
    return values_.data() + before;
  }
  T* begin() { return values_.data(); }
  std::vector<T> take() { return std::move(values_); }

 private:
  std::size_t row_size_;
  std::vector<T> values_;
};

/// Turns pictures whose first row is the lowest.
template <class T>
void turn_rows(std::vector<T>& values, std::size_t row_size) {
  const auto row = [&](std::size_t y) { return values.begin() + std::ptrdiff_t(y * row_size); };
  const std::size_t rows = values.size() / row_size;
  for (std::size_t y = 0; y < rows / 2; ++y)
    std::swap_ranges(row(y), row(y + 1), row(rows - 1 - y));
}

Texture decode_png(const Source& source);
Texture decode_jpeg(const Source& source);
Texture decode_hdr(const Source& source);
Texture decode_exr(const Source& source);
Texture decode_bmp(const Source& source);
Texture decode_tga(const Source& source);
Texture decode_tiff(const Source& source);
Texture decode_webp(const Source& source);
Texture decode_jpeg_2000(const Source& source);

std::vector<std::byte> encode_png(const ImageView& image);
std::vector<std::byte> encode_jpeg(const ImageView& image);
std::vector<std::byte> encode_hdr(const ImageView& image);
std::vector<std::byte> encode_exr(const ImageView& image);

}  // namespace diorama::images
